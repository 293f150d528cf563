// SPDX-License-Identifier: MIT OR Apache-2.0
//! Unreasonable sources: each gets one clear error. The named limits count steps (statements, nodes, files, depth), and none of these
//! sources ends without them; an algorithm that is quadratic in its source takes hours, which stops the run of the tests.

use crate::common;
use crate::common::{bad, good};
use takt_asm::{FileLoader, LoadError, Loader, MemoryLoader, diag::Diagnostics, limits};
use takt_isa::{F1, F3};

#[track_caller]
fn error(text: &str, code: &str) -> Diagnostics {
    let report = bad(text, &F3);
    let first = report.list.iter().find(|diagnostic| diagnostic.code == code);
    let rendered = report.render(false);
    assert!(first.is_some(), "no `{code}`:\n{}", &rendered[..rendered.len().min(4000)]);
    // The report's lines are short, however long the source's lines are.
    assert!(rendered.len() < 200_000, "{} bytes of report", rendered.len());
    report
}

/// On the smallest stack that a system gives a program's first thread: Windows' 1 MiB.
#[test]
fn deep_expressions() {
    let thread = std::thread::Builder::new().stack_size(1 << 20).spawn(deep).unwrap();
    thread.join().unwrap();
}

fn deep() {
    for text in ["(", "-", "~", "2^", "sqrt(", "x{", "(-"] {
        error(&format!(".const X = {}", text.repeat(200_000)), "limit");
        error(&format!(".period\n mov a, {}1", text.repeat(200_000)), "limit");
    }
    error(&format!(".period\n ld a, {}", "0[".repeat(200_000)), "limit");
    error(&format!(".const X = {}", ")".repeat(200_000)), "limit");
    // A source within the limit is read.
    for nest in [limits::EXPRESSION_DEPTH - 1, limits::EXPRESSION_DEPTH] {
        good(&format!(".const X = {}1{}\n.data\n .word X\n", "(".repeat(nest), ")".repeat(nest)));
        good(&format!(".const X = {}1\n.data\n .word X\n", "-".repeat(nest)));
        good(&format!(".const X = 1{}\n.data\n .word X\n", "^1".repeat(nest)));
    }
    let one = limits::EXPRESSION_DEPTH + 1;
    error(&format!(".const X = {}1{}\n", "(".repeat(one), ")".repeat(one)), "limit");
    error(&format!(".const X = 1{}\n", "^1".repeat(one)), "limit");
}

#[test]
fn long_expressions_that_do_not_nest() {
    good(&format!(".const X = 0{}\n.data\n .word X\n", " + -1^2 - (-1)".repeat(2_000)));
    good(&format!(".data\n .word 1{}\n", ", -2^2".repeat(1_000)));
    error(&format!(".const X = 1{}\n", "+1".repeat(100_000)), "limit");
}

#[test]
fn long_lines() {
    let long = "x".repeat(limits::LINE_BYTES);
    error(&format!(".const {long} = 1"), "token");
    error(&format!(".data\n .word {}\n", "1,".repeat(limits::LINE_BYTES)), "limit");
    error(&format!(".error \"{long}\""), "limit");
    error(&format!(" nop {}", "|| nop ".repeat(100_000)), "limit");
    // A file of the greatest length without a line break: many tokens, and a single token.
    error(&format!(".data\n .word {}", ",".repeat(limits::FILE_BYTES - 20)), "limit");
    error(&"x".repeat(limits::FILE_BYTES), "token");
    error(&" nop ||\n".repeat(limits::FILE_BYTES / 8), "limit");
    // A comment may be as long as it likes.
    good(&format!("; {long}{long}\n"));
    // For a long line the report shows the part around the mistake, with the right column.
    let text = format!(".data\n .word {}mistake, {}1\n", "1, ".repeat(10_000), "1, ".repeat(1_000));
    let report = error(&text, "unknown-name");
    let messages = report.messages();
    let mistake = messages.iter().find(|message| message.code == "unknown-name").expect("it is reported");
    assert_eq!(mistake.places[0].column, 30_008);
    assert!(report.render(false).contains("test.s:2:30008"));
    assert!(report.render(false).contains("mistake"));
}

#[test]
fn bundles_that_are_too_wide() {
    let text = format!(".reg a\n.period\n mov a, 1{}\n", " || nop".repeat(limits::BUNDLE_OPERATIONS));
    let report = bad(&text, &F1);
    assert!(report.render(false).contains("a bundle of 65 operations"));
}

#[test]
fn repetitions_without_end() {
    error(".rep i, 1, 1000000000\n nop\n.endr\n", "limit");
    error(".rep i, -9223372036854775807, 9223372036854775807\n nop\n.endr\n", "limit");
    error(".rep i, 1, 1000000\n.rep j, 1, 1000000\n.endr\n.endr\n", "limit");
    error(".rep i, 1, 1000000\n.rep j, 1, 1000000\n nop\n.endr\n.endr\n", "limit");
    error(".data\n.rep i, 1, 1000000\n .space 1000000\n.endr\n", "limit");
    error(".data\n .space 9223372036854775807\n", "limit");
    error(".data\n .space -1\n", "limit");
    // Deep nests of blocks.
    error(&".rep i, 1, 1\n".repeat(100_000), "limit");
    error(&".if 1\n".repeat(100_000), "limit");
}

#[test]
fn macros_without_end() {
    error(".macro m\n m\n.endm\n m\n", "limit");
    error(".macro m\n m\n m\n.endm\n m\n", "limit");
    error(".macro m x\n.if x\n m x-1\n m x-1\n.endif\n.endm\n m 60\n", "limit");
    // Arguments that grow at every level are computed once each.
    let mut text = String::from(".macro m0 x\n.const X = x\n.endm\n");
    for level in 1..60 {
        text += &format!(".macro m{level} x\n m{} x+x\n.endm\n", level - 1);
    }
    good(&format!("{text} m59 1\n"));
    // Names that depend on names, to the greatest depth.
    let depth = limits::EXPRESSION_DEPTH;
    error(&format!(".const X = {}1{}\n", "x{".repeat(depth), "}".repeat(depth)), "unknown-name");
}

#[test]
fn includes_without_end() {
    let mut loader = MemoryLoader::default();
    for level in 0..limits::INCLUDE_DEPTH + 1 {
        loader.add(format!("f{level}.s"), format!(".include \"f{}.s\"\n", level + 1));
    }
    loader.add(format!("f{}.s", limits::INCLUDE_DEPTH + 1), "");
    let report = takt_asm::assemble("f0.s", &loader, &common::options(&F3)).expect_err("too deep");
    assert!(report.render(false).contains("include one another more than 32 deep"));
    // Each file includes the next twice: exponentially many.
    let mut loader = MemoryLoader::default();
    for level in 0..30 {
        let next = format!(".include \"f{}.s\"\n", level + 1);
        loader.add(format!("f{level}.s"), next.repeat(2));
    }
    loader.add("f30.s", "");
    let report = takt_asm::assemble("f0.s", &loader, &common::options(&F3)).expect_err("too many");
    assert!(report.render(false).contains("files are included more than"), "{}", report.render(false));
}

#[test]
fn errors_without_end() {
    let report = error(&".period\n frobnicate\n".repeat(50_000), "unknown-instruction");
    assert_eq!(report.list.len(), limits::SHOWN);
    assert_eq!(report.more_errors, 50_000 - limits::SHOWN);
    assert!(report.render(false).ends_with("… and 49980 more errors\n"));
    assert_eq!(report.render(false).matches("error[").count(), limits::PRINTED);
    error(&" mov 1 1\n".repeat(50_000), "syntax");
    error(&".endr\n".repeat(50_000), "block");
    error(&"x: nop\n".repeat(50_000), "declared-twice");
    error(&".const A = 1/0\n".repeat(50_000), "expression");
    error(&"§\n".repeat(50_000), "token");
    error(&(0..50_000).map(|i| format!(" mov a{i}, b{i}\n")).collect::<String>(), "unknown-name");
    // Each name is compared with all declared names.
    let names: String = (0..50_000).map(|i| format!(".const name{i} = 1\n")).collect();
    error(&(names + &(0..2_000).map(|i| format!(" mov nane{i}, 1\n")).collect::<String>()), "unknown-name");
    let warnings = good(&(0..50_000).map(|i| format!(".reg r{i}\n")).collect::<String>()).warnings;
    assert_eq!((warnings.list.len(), warnings.more_warnings), (limits::SHOWN, 50_000 - limits::SHOWN));
}

#[test]
fn rejects_many_large_items() {
    // Parameters, arguments, names of one scope.
    let parameters: Vec<String> = (0..20_000).map(|i| format!("p{i}")).collect();
    let arguments = vec!["1"; 20_000].join(", ");
    let body: String = (0..20_000).map(|i| format!(".const c{i} = p{i} + 1\n")).collect();
    good(&format!(".macro m {}\n{body}.endm\n m {arguments}\n", parameters.join(" ")));
    // Macros that are used often, repetitions with declarations.
    good(".macro m x\n.const y = x\nl: \n.endm\n.rep i, 1, 100000\n m i\n.endr\n");
    good(".rep i, 1, 100000\n.const k{i} = i\n.endr\n.if k100000 != 100000\n.error \"lost\"\n.endif\n");
    // Branches of one condition.
    good(&format!(".if 0\n{}.endif\n", ".elif 0\n".repeat(100_000)));
    // Blank and odd lines.
    good(&"\n".repeat(1_000_000));
    good(&"; comment\r\n\t\x0c\r\n".repeat(100_000));
    error(&"\0".repeat(1_000_000), "token");
    error(&"\"".repeat(1_000_000), "limit");
    error(&"\"\n".repeat(100_000), "token");
    error(&"{".repeat(1_000_000), "limit");
    error(&"}".repeat(1_000_000), "limit");
    error(&"}\n".repeat(100_000), "syntax");
    error(&"x{".repeat(300_000), "limit");
    error(&"0x".repeat(300_000), "token");
    error(&" ||\n".repeat(200_000), "syntax");
}

#[test]
fn rejects_large_files_and_binary_files() {
    let fails = |bytes: Vec<u8>| {
        let report = takt_asm::assemble("a.s", &MemoryLoader::of("a.s", bytes), &common::options(&F3));
        report.expect_err("it is refused").render(false)
    };
    assert!(fails(vec![b'\n'; limits::FILE_BYTES + 1]).contains("more than the 67108864 bytes"));
    assert!(fails(b"nop\nn\xffp".to_vec()).contains("byte 0xff at offset 5 (line 2, byte 2 of the line)"));
    let mut loader =
        MemoryLoader::of("a.s", (0..5).map(|i| format!(".include \"b{i}.s\"\n")).collect::<String>());
    for i in 0..5 {
        loader.add(format!("b{i}.s"), vec![b'\n'; limits::FILE_BYTES]);
    }
    let report = takt_asm::assemble("a.s", &loader, &common::options(&F3)).expect_err("too much in all");
    assert!(report.render(false).contains("more than the 268435456 bytes"));
}

#[test]
fn the_file_loader_stays_in_its_folder() {
    let root = std::env::temp_dir().join(format!("takt-asm-loader-{}", std::process::id()));
    let project = root.join("project");
    std::fs::create_dir_all(project.join("sub")).expect("a folder");
    let write = |path: &str, text: &str| std::fs::write(root.join(path), text).expect("a file");
    write("secret.s", " nop\n");
    write("project/a.s", " nop\n");
    write("project/sub/b.s", " nop\n");
    let loader = FileLoader::new(&project);
    assert_eq!(loader.load("a.s").as_deref(), Ok(&b" nop\n"[..]));
    assert_eq!(loader.load("sub/b.s").as_deref(), Ok(&b" nop\n"[..]));
    assert_eq!(loader.load("missing.s"), Err(LoadError::NotFound));
    assert_eq!(loader.load("sub"), Err(LoadError::NotAFile));
    assert_eq!(loader.load("../secret.s"), Err(LoadError::Outside));
    assert_eq!(loader.load("sub/../../secret.s"), Err(LoadError::Outside));
    assert_eq!(loader.load("/etc/passwd"), Err(LoadError::Outside));
    assert_eq!(loader.load("a\0.s"), Err(LoadError::NotFound));
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("../secret.s", project.join("link.s")).expect("a link");
        std::os::unix::fs::symlink(&root, project.join("up")).expect("a link");
        std::os::unix::fs::symlink("a.s", project.join("inside.s")).expect("a link");
        assert_eq!(loader.load("link.s"), Err(LoadError::Outside));
        assert_eq!(loader.load("up/secret.s"), Err(LoadError::Outside));
        assert_eq!(loader.load("inside.s").as_deref(), Ok(&b" nop\n"[..]));
    }
    let (loader, name) = FileLoader::of_file(project.join("a.s")).expect("it names a file");
    assert_eq!(loader.load(&name).as_deref(), Ok(&b" nop\n"[..]));
    std::fs::remove_dir_all(&root).expect("it is ours");
}

#[test]
fn standard_input_has_no_file() {
    let loader = MemoryLoader::of("b.s", ".const B = 2\n");
    let assembled = takt_asm::assemble_bytes(
        "-",
        b".include \"b.s\"\n.data\n .word B\n".to_vec(),
        &loader,
        &common::options(&F3),
    );
    assert_eq!(assembled.map(|assembled| assembled.program.data).ok(), Some(vec![2]));
}
