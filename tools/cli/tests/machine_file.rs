// SPDX-License-Identifier: MIT OR Apache-2.0
//! Machine files wherever a machine's name is accepted; `asm/tests/machine_files.rs` tests all mistakes in such files.

use crate::common::{Folder, source};

/// A folder that contains t3's file, a copy with a second adder, and the controller.
fn workshop() -> Folder {
    let folder = Folder::new();
    let t3 = folder.takt(&["machines", "t3", "--toml"]).ok();
    folder.write("t3.toml", &t3);
    let own = t3.replace("name = \"t3\"", "name = \"t3a\"").replace("\"alu\",", "\"alu\",\n    \"add\",");
    folder.write("t3a.toml", &own);
    folder.write("slow.toml", own.replace("\"divroot\",", "{ unit = \"divroot\", latency = 12 },"));
    folder.write("three.toml", own.replace("depth = 256\nunits", "depth = 192\nunits"));
    folder.write("loop.s", ".input a\n.output y\n.once\n wait p\n.period\np: fadd y, a, a\n wait p\n");
    folder
}

/// A printed row describes the same machine: images are equal byte for byte.
#[test]
fn a_round_trip() {
    let folder = workshop();
    let source = source("tracking.s");
    for (machine, image) in [("t3", "a.elf"), ("t3.toml", "b.elf"), ("t3.toml,data=1024", "c.elf")] {
        folder.takt(&["asm", source.as_str(), "-m", machine, "-o", image]).ok();
    }
    assert_eq!(folder.read("a.elf"), folder.read("b.elf"));
    assert_eq!(folder.read("a.elf"), folder.read("c.elf"));
}

/// An image can be used without its machine file, and its disassembly assembles again.
#[test]
fn an_image_needs_no_file() {
    let folder = workshop();
    folder.takt(&["asm", "loop.s", "-m", "t3a.toml,data=4096", "-o", "loop.elf"]).ok();
    std::fs::rename(folder.path().join("t3a.toml"), folder.path().join("moved.toml")).unwrap();
    let ran = folder.takt(&["run", "loop.elf", "--periods", "3", "--json"]).ok();
    assert!(ran.contains("\"t3a,data=4096\""), "{ran}");
    let text = folder.takt(&["disasm", "loop.elf"]).ok();
    assert!(text.contains("; For machine t3a,data=4096"), "{text}");
    folder.write("again.s", text);
    folder.takt(&["asm", "again.s", "-m", "moved.toml,data=4096", "-o", "again.elf", "--strip"]).ok();
    folder.takt(&["asm", "loop.s", "-m", "moved.toml,data=4096", "-o", "stripped.elf", "--strip"]).ok();
    let again = folder.takt(&["disasm", "again.elf"]).ok();
    assert_eq!(again, folder.takt(&["disasm", "stripped.elf"]).ok());
}

/// A system refers to a machine file relative to its own folder.
#[test]
fn a_system_of_it() {
    let folder = workshop();
    std::fs::create_dir(folder.path().join("sub")).unwrap();
    for name in ["loop.s", "t3a.toml"] {
        folder.write(format!("sub/{name}"), folder.read(name));
    }
    let system = "tick = 1000\n[[core]]\nname = \"a\"\nprogram = \"loop.s\"\nmachine = \"t3a.toml\"\n[[wire]]\nfrom = \"host.a\"\nto = \"a.a\"\n";
    folder.write("sub/system.toml", system);
    let bound = folder.takt(&["bound", "sub/system.toml", "--json"]).ok();
    assert!(bound.contains("\"t3a\""), "{bound}");
    folder.write("sub/system.toml", system.replace("t3a.toml", "none.toml"));
    let told = folder.takt(&["bound", "sub/system.toml"]);
    assert!(told.stderr.contains("sub/system.toml:5:11") && told.stderr.contains("none.toml"), "{told:?}");
}

/// Mistakes that only the circuit generator finds are also reported at their places in the file.
#[test]
fn rows_without_a_circuit() {
    let folder = workshop();
    let mut text = String::new();
    for line in [
        "rtl -m slow.toml -o build",
        "rtl -m three.toml -o build",
        "machines slow.toml --toml",
        "machines slow.toml,data=3",
        "machines none.toml",
        "run slow.toml",
        "asm loop.s -m t3b.toml",
        "machines --toml",
    ] {
        let done = folder.line(line);
        let toml = if done.stdout.is_empty() { "" } else { "(a result)\n" };
        text += &format!("$ takt {line}\n{toml}{}[{}]\n\n", done.stderr, done.status.unwrap());
    }
    insta::assert_snapshot!(text);
}
