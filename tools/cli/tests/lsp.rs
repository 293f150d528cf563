// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt lsp` with two clients: on standard input and output, and Neovim.

use crate::common::protocol::Client;
use crate::common::{Folder, source};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use takt_isa::{Function, T3, Type, Unit};

/// A session with documents in a folder.
struct Session {
    client: Client,
    folder: Folder,
    versions: BTreeMap<String, i64>,
}

impl Session {
    fn new(files: &[(&str, &str)]) -> Session {
        let folder = Folder::new();
        for (name, text) in files {
            folder.write(name, text);
        }
        let mut client = Client::start(&folder, "lsp");
        let root = format!("file://{}", folder.path().display());
        let capabilities = json!({
            "workspace": { "inlayHint": { "refreshSupport": true } },
            "experimental": { "takt/counted": true, "takt/runs": true },
        });
        let answer = client.ask(
            "initialize",
            json!({ "capabilities": capabilities, "workspaceFolders": [{ "uri": root, "name": "test" }] }),
        );
        assert_eq!(answer["result"]["capabilities"]["positionEncoding"], "utf-16");
        client.notify("initialized", json!({}));
        Session { client, folder, versions: BTreeMap::new() }
    }

    fn uri(&self, name: &str) -> String {
        format!("file://{}", self.folder.path().join(name).display())
    }

    fn open(&mut self, name: &str, text: &str) -> Vec<Value> {
        let uri = self.uri(name);
        self.versions.insert(name.to_owned(), 1);
        let document = json!({ "uri": uri, "languageId": "takt", "version": 1, "text": text });
        self.client.notify("textDocument/didOpen", json!({ "textDocument": document }));
        self.told(name)
    }

    /// Replaces a text that occurs exactly once.
    fn edit(&mut self, name: &str, text: &str, from: &str, to: &str) -> String {
        assert_eq!(text.matches(from).count(), 1, "{from}");
        let (start, end) = (position(text, from, 0), position(text, from, from.len()));
        let version = self.versions.get_mut(name).unwrap();
        *version += 1;
        let change = json!({ "range": { "start": start, "end": end }, "text": to });
        let document = json!({ "uri": self.uri(name), "version": self.versions[name] });
        self.client.notify(
            "textDocument/didChange",
            json!({ "textDocument": document, "contentChanges": [change] }),
        );
        text.replace(from, to)
    }

    /// Next published diagnostics of a document.
    fn told(&mut self, name: &str) -> Vec<Value> {
        let uri = self.uri(name);
        let message = self.client.wait(|message| {
            message["method"] == "textDocument/publishDiagnostics" && message["params"]["uri"] == *uri
        });
        message["params"]["diagnostics"].as_array().unwrap().clone()
    }

    fn at(&self, name: &str, text: &str, of: &str) -> Value {
        json!({ "textDocument": { "uri": self.uri(name) }, "position": position(text, of, 0) })
    }

    fn ask(&mut self, method: &str, params: Value) -> Value {
        let answer = self.client.ask(method, params);
        assert!(answer.get("error").is_none(), "{method}: {answer}");
        answer["result"].clone()
    }

    fn rename(&mut self, name: &str, text: &str, of: &str, to: &str) -> Value {
        let mut params = self.at(name, text, of);
        params["newName"] = to.into();
        self.client.ask("textDocument/rename", params)
    }

    /// Texts of the files after a workspace edit.
    fn applied(&self, answer: &Value, files: &[(&str, &str)]) -> Vec<String> {
        assert!(answer.get("error").is_none(), "{answer}");
        let changes = answer["result"]["changes"].as_object().unwrap();
        files
            .iter()
            .map(|(name, text)| {
                let mut lines: Vec<String> = text.split('\n').map(str::to_owned).collect();
                let mut edits = changes
                    .get(&self.uri(name))
                    .map_or(Vec::new(), |edits| edits.as_array().unwrap().clone());
                let start = |edit: &Value| {
                    (
                        edit["range"]["start"]["line"].as_u64().unwrap(),
                        edit["range"]["start"]["character"].as_u64().unwrap(),
                    )
                };
                edits.sort_by_key(|edit| std::cmp::Reverse(start(edit)));
                for edit in edits {
                    let (line, from) = start(&edit);
                    let to = edit["range"]["end"]["character"].as_u64().unwrap();
                    // All texts are ASCII, so columns equal bytes.
                    lines[line as usize]
                        .replace_range(from as usize..to as usize, edit["newText"].as_str().unwrap());
                }
                lines.join("\n")
            })
            .collect()
    }

    fn end(mut self) {
        self.ask("shutdown", Value::Null);
        self.client.notify("exit", Value::Null);
        let (status, stderr) = self.client.end();
        assert_eq!((status, stderr.as_str()), (Some(0), ""));
    }
}

/// Position `more` bytes after the first occurrence of a text.
fn position(text: &str, of: &str, more: usize) -> Value {
    let at = text.find(of).unwrap_or_else(|| panic!("{of}")) + more;
    let start = text[..at].rfind('\n').map_or(0, |at| at + 1);
    json!({ "line": text[..at].matches('\n').count(), "character": text[start..at].encode_utf16().count() })
}

/// Diagnostics of `takt asm` for a file: code, message and first place.
fn told_by_asm(folder: &Folder, file: &str) -> Vec<(String, String, u64, u64)> {
    let done = folder.line(&format!("asm {file} --check --json"));
    let json: Value = serde_json::from_str(&done.stdout).unwrap();
    let messages = json["messages"].as_array().unwrap_or_else(|| panic!("{json}"));
    let place = |message: &Value, what: &str| message["places"][0][what].as_u64().unwrap_or(1);
    let one = |message: &Value| {
        let text = |what: &str| message[what].as_str().unwrap().to_owned();
        (text("code"), text("message"), place(message, "line"), place(message, "column"))
    };
    messages.iter().map(one).collect()
}

/// Diagnostics of the server, in the form of [`told_by_asm`].
fn shown(told: &[Value], text: &str) -> Vec<(String, String, u64, u64)> {
    let one = |told: &Value| {
        let start = &told["range"]["start"];
        let message = told["message"].as_str().unwrap().lines().next().unwrap().to_owned();
        let line = start["line"].as_u64().unwrap();
        // Columns of `takt asm` count characters.
        let of_line = text.lines().nth(line as usize).unwrap_or("");
        let units: Vec<u16> =
            of_line.encode_utf16().take(start["character"].as_u64().unwrap() as usize).collect();
        let column = String::from_utf16(&units).unwrap().chars().count() as u64;
        (told["code"].as_str().unwrap().to_owned(), message, line + 1, column + 1)
    };
    let mut list: Vec<_> = told.iter().map(one).collect();
    list.sort();
    list
}

/// For all mistakes in the assembler's tests, server and `takt asm` report the same diagnostics.
#[test]
fn diagnostics_are_those_of_the_assembler() {
    let mistakes = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../asm/tests/mistakes");
    let mut session = Session::new(&[]);
    let (mut compared, mut later) = (0, 0);
    for entry in std::fs::read_dir(mistakes).unwrap() {
        let path = entry.unwrap().path();
        let Ok(text) = std::fs::read_to_string(&path) else { continue };
        // Assemble sources for other machines for this one, as the server does, which gives other mistakes.
        let name = format!("{compared}/main.s");
        std::fs::create_dir(session.folder.path().join(compared.to_string())).unwrap();
        session.folder.write(&name, &text);
        let mut expected = told_by_asm(&session.folder, &name);
        expected.sort();
        for message in &mut expected {
            message.1 = message.1.lines().next().unwrap().to_owned();
        }
        let mut told = shown(&session.open(&name, &text), &text);
        if told != expected {
            // Diagnostics of the assembler come first; those of the scheduler follow when it is done.
            assert!(
                told.iter().all(|one| expected.contains(one)),
                "{}: {told:?} {expected:?}",
                path.display()
            );
            told = shown(&session.told(&name), &text);
            assert_eq!(told, expected, "{}", path.display());
            later += 1;
        }
        session
            .client
            .notify("textDocument/didClose", json!({ "textDocument": { "uri": session.uri(&name) } }));
        compared += 1;
    }
    assert!(compared > 40 && later > 3);
    session.end();
}

const PART: &str = "\
.const  K = 0.25
.macro  scale to, by
.reg    tmp
        fmul    tmp, to, by*K
        mov     to, tmp
.endm
.macro  never a
        fadd    a, a, K
.endm
";

const MAIN: &str = "\
.include \"part.s\"
.input  x, n:int
.output F
.schedule on
.period
period:
.rep i, 1, 3
.reg    p{i}
        fmul    p{i}, x, i*K
        scale   p{i}, 2
.endr
        fadd    F, p1, p2
        wait    period
";

#[test]
fn names_are_followed_through_macros_repetitions_and_includes() {
    let files = [("main.s", MAIN), ("part.s", PART)];
    let mut session = Session::new(&files);
    let warnings = session.open("main.s", MAIN);
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    session.open("part.s", PART);

    let declared = session.ask("textDocument/definition", session.at("main.s", MAIN, "K\n"));
    assert_eq!(declared[0]["uri"], session.uri("part.s"));
    assert_eq!(declared[0]["range"]["start"], position(PART, "K", 0));
    let mut params = session.at("part.s", PART, "K");
    params["context"] = json!({ "includeDeclaration": false });
    let references = session.ask("textDocument/references", params);
    assert_eq!(references.as_array().unwrap().len(), 2, "{references}");

    // A constant: renamed in both files, and in an unused macro.
    let answer = session.rename("main.s", MAIN, "K\n", "gain");
    let texts = session.applied(&answer, &files);
    assert_eq!(texts, [MAIN.replace('K', "gain"), PART.replace('K', "gain")]);
    // A family of registers, renamed from a use of one member.
    let answer = session.rename("main.s", MAIN, "p{i}, x", "pos{i}");
    let texts = session.applied(&answer, &files);
    assert_eq!(texts[0], MAIN.replace("p{i}", "pos{i}").replace("p1, p2", "pos1, pos2"));
    assert_eq!(texts[1], PART);
    // A parameter and a local name, only in the macro; the macro itself, in both files.
    for (of, to) in [("to, by", "target"), ("tmp, to", "t"), ("scale", "times")] {
        let old = of.split(',').next().unwrap();
        let answer = session.rename("part.s", PART, of, to);
        let texts = session.applied(&answer, &files);
        let (again, main) = (PART.replace(old, to), MAIN.replace(old, to));
        assert_eq!(texts, [if old == "scale" { main } else { MAIN.to_owned() }, again], "{of}");
    }
    // A rename that would change the program's meaning is rejected with the reason.
    for (of, to, why) in [
        ("K\n", "x", "would change"),
        ("p{i}, x", "x{i}x", "must end in `{i}`"),
        ("x, n", "1x", "is not a name"),
        ("fadd", "fsub", "no name here"),
    ] {
        let answer = session.rename("main.s", MAIN, of, to);
        let message = answer["error"]["message"].as_str().unwrap_or_else(|| panic!("{answer}"));
        assert!(message.contains(why), "{message}");
    }
    session.end();
}

const EQUATIONS: &str = "\
.input  x, y
.output F, G
.macro  halve r, a
        fmul    r, a, 0.5
.endm
.period
.reg    v[3] t
period:
        .rep i, 1, 3
        v[i] = i*x + y
        .endr
        t = sum(k, 1, 3, k*v[k])
        F, G = t - halve(x*y), v[2] > 0 ? t : y
        wait    period
";

#[test]
fn names_of_equations_and_arrays_are_followed() {
    let files = [("main.s", EQUATIONS)];
    let mut session = Session::new(&files);
    assert_eq!(session.open("main.s", EQUATIONS), Vec::<Value>::new());
    for (of, to, from, into) in [
        ("v[3]", "w", "v[", "w["),
        ("t = sum", "total", "t ", "total "),
        ("k, 1", "index", "(k, 1, 3, k*v[k]", "(index, 1, 3, index*v[index]"),
        ("halve(", "half", "halve", "half"),
        ("x*y", "speed", "x", "speed"),
    ] {
        let answer = session.rename("main.s", EQUATIONS, of, to);
        let texts = session.applied(&answer, &files);
        let expected = match of {
            "t = sum" => EQUATIONS
                .replace(" t\n", " total\n")
                .replace("t = ", "total = ")
                .replace("= t ", "= total ")
                .replace("? t ", "? total "),
            _ => EQUATIONS.replace(from, into),
        };
        assert_eq!(texts, [expected], "{of}");
    }
    // The result is formatted exactly as by `takt fmt`.
    assert_eq!(session.folder.line("fmt --check main.s").status, Some(0));
    session.end();
}

#[test]
fn an_included_file_is_read_as_it_is_open() {
    let mut session = Session::new(&[("main.s", MAIN), ("part.s", PART)]);
    session.open("main.s", MAIN);
    session.open("part.s", PART);
    // An unsaved edit: the file on disk stays unchanged.
    let edited = session.edit("part.s", PART, ".const  K", ".const  L");
    let told = session.told("main.s");
    assert!(
        told.iter().any(|one| one["message"].as_str().unwrap().starts_with("`K` is not declared")),
        "{told:?}"
    );
    session.edit("part.s", &edited, ".const  L", ".const  K");
    let told = session.told("main.s");
    assert!(told.iter().all(|one| one["severity"] == 2), "{told:?}");
    session.end();
}

#[test]
fn suggested_spelling_fixes_the_name() {
    let mut session = Session::new(&[("main.s", MAIN), ("part.s", PART)]);
    session.open("main.s", MAIN);
    let edited = session.edit("main.s", MAIN, "fadd ", "fadf ");
    let told = session.told("main.s");
    let wrong = told.iter().find(|one| one["code"] == "unknown-instruction").unwrap();
    assert!(wrong["message"].as_str().unwrap().contains("help: did you mean `fadd`?"));
    let params = json!({ "textDocument": { "uri": session.uri("main.s") }, "range": wrong["range"], "context": { "diagnostics": [] } });
    let actions = session.ask("textDocument/codeAction", params);
    let fix = actions.as_array().unwrap().iter().find(|action| action["title"] == "write `fadd`").unwrap();
    let texts = session.applied(&json!({ "result": fix["edit"] }), &[("main.s", &edited)]);
    assert_eq!(texts, [MAIN]);
    session.end();
}

/// The assembler's suggestions are offered as quick fixes, which repair the source.
#[test]
fn each_suggestion_is_a_code_action() {
    let cases = [
        (".input n:int\n.output y\n.period\np: y = n*2.5\n wait p\n", "n*", "write `itof(n)`"),
        (
            ".include \"math.s\"\n.output y\n.period\np: mov y, zero\n wait p\n",
            ".inc",
            "write `.include <math.s>`",
        ),
        ("; about\n.output y\n.period\np: fadd y, x, 1.0\n wait p\n", "x, 1", "add `.input x`"),
        (".input x\n.period\np: fadd y, x, 1.0\n wait p\n", "y, x", "add `.output y`"),
        ("; about\n.input x\n.output y\n.period\np: exp y, x\n wait p\n", "exp", "add `.include <math.s>`"),
    ];
    let mut session = Session::new(&[]);
    for (number, (text, at, title)) in cases.into_iter().enumerate() {
        let name = format!("{number}.s");
        assert!(session.open(&name, text).iter().any(|one| one["severity"] == 1), "{text}");
        let at = position(text, at, 0);
        let params = json!({ "textDocument": { "uri": session.uri(&name) }, "range": { "start": at, "end": at }, "context": { "diagnostics": [] } });
        let actions = session.ask("textDocument/codeAction", params);
        let fix = actions.as_array().unwrap().iter().find(|action| action["title"] == title);
        let fix = fix.unwrap_or_else(|| panic!("{title}: {actions}"));
        let mended = session.applied(&json!({ "result": fix["edit"] }), &[(&name, text)]).remove(0);
        session.folder.write(&name, &mended);
        assert_eq!(session.folder.line(&format!("asm {name} --check")).status, Some(0), "{title}:\n{mended}");
    }
    session.end();
}

/// An instruction becomes an equation that assembles to it, and back, for every operation with a form in equations.
#[test]
fn instructions_and_equations_are_rewritten() {
    let mut session = Session::new(&[]);
    let of = |ty: Type| match ty {
        Type::F => "float",
        Type::I => "int",
        Type::B => "bits",
    };
    let actions = |session: &mut Session, name: &str, text: &str| -> Vec<Value> {
        let at = position(text, "y ", 0);
        let params = json!({
            "textDocument": { "uri": session.uri(name) }, "range": { "start": at, "end": at },
            "context": { "diagnostics": [], "only": ["refactor"] },
        });
        session.ask("textDocument/codeAction", params).as_array().unwrap().clone()
    };
    // Of an equation, places have columns; of an instruction, they have none.
    let code = |session: &Session, name: &str, text: &str| -> String {
        session.folder.write(name, text);
        session.folder.line(&format!("asm {name} -o image")).ok();
        let whole = session.folder.line("disasm image").ok();
        whole
            .lines()
            .skip_while(|line| !line.starts_with(".period"))
            .filter(|line| !line.contains(".loc "))
            .collect()
    };
    for row in takt_isa::ROWS.iter().filter(|row| !row.forms.is_empty()) {
        let name = format!("{}.s", row.mnemonic);
        let sources = ["a", "b", "c"].into_iter().zip(&row.types[1..]);
        let ports: String =
            sources.clone().map(|(name, ty)| format!(".input {name}:{}\n", of(*ty))).collect();
        let names: Vec<&str> = sources.map(|(name, _)| name).collect();
        let operation = format!("{:<7} y , {}", row.mnemonic, names.join(", "));
        let text = format!(
            ".machine t4\n{ports}.output y:{}\n.period\np: {operation} ; it\n wait p\n",
            of(row.types[0])
        );
        session.open(&name, &text);
        let found = actions(&mut session, &name, &text);
        let [action] = &found[..] else { panic!("{operation}: {found:?}") };
        assert_eq!(action["title"], format!("write `y = {}`", row.forms[0]));
        let equation = session.applied(&json!({ "result": action["edit"] }), &[(&name, &text)]).remove(0);
        assert_eq!(code(&session, &name, &equation), code(&session, &name, &text), "{equation}");

        let name = format!("{}_equation.s", row.mnemonic);
        session.open(&name, &equation);
        let back = actions(&mut session, &name, &equation);
        let back: Vec<String> = back
            .iter()
            .map(|action| {
                session.applied(&json!({ "result": action["edit"] }), &[(&name, &equation)]).remove(0)
            })
            .collect();
        assert!(back.contains(&text.replace("y ,", "y,")), "{equation}\n{back:?}");
    }
    session.end();
}

/// Cycles are shown beside lines and above the section, and keep their places when lines are added.
#[test]
fn cycles_stand_beside_the_lines() {
    let mut session = Session::new(&[("main.s", MAIN), ("part.s", PART)]);
    session.open("main.s", MAIN);
    session.client.wait(|message| message["method"] == "workspace/inlayHint/refresh");
    let uri = session.uri("main.s");
    let range = json!({ "start": { "line": 0, "character": 0 }, "end": { "line": 99, "character": 0 } });
    let params = json!({ "textDocument": { "uri": uri }, "range": range });
    let lines = |hints: &Value| -> Vec<(u64, String)> {
        let hint = |hint: &Value| {
            (hint["position"]["line"].as_u64().unwrap(), hint["label"].as_str().unwrap().to_owned())
        };
        hints.as_array().unwrap().iter().map(hint).collect()
    };
    let before = lines(&session.ask("textDocument/inlayHint", params.clone()));
    let wait = before.iter().find(|(line, _)| *line == 12).unwrap();
    let (slot, _) = T3.host(Function::Control).unwrap();
    assert!(wait.1.contains(&format!(" · {}", T3.slot(slot).name)), "{before:?}");
    let lenses = session.ask("textDocument/codeLens", json!({ "textDocument": { "uri": uri } }));
    let bound = session.folder.line("bound main.s --json").stdout;
    let bound: Value = serde_json::from_str(&bound).unwrap();
    let cycles = &bound["sections"]
        .as_array()
        .unwrap()
        .iter()
        .find(|section| section["name"] == "period")
        .unwrap()["cycles"];
    let title = lenses[0]["command"]["title"].as_str().unwrap();
    assert!(title.starts_with(&format!("period: {} cycles, lower bound ", cycles["worst"])), "{title}");
    assert_eq!(lenses[0]["range"]["start"]["line"], 5);
    for (lens, command) in lenses.as_array().unwrap().iter().rev().zip(["debug", "run"]) {
        assert_eq!(lens["range"], lenses[0]["range"]);
        let wanted = json!({ "title": command, "command": format!("takt.{command}"), "arguments": [uri] });
        assert_eq!(lens["command"], wanted);
    }

    // Insert two lines above; old hints move with their lines until the new counts arrive.
    session.edit("main.s", MAIN, ".schedule on\n", "\n\n.schedule on\n");
    let after = lines(&session.ask("textDocument/inlayHint", params));
    let moved: Vec<_> = before.iter().map(|(line, text)| (line + 2, text.clone())).collect();
    assert_eq!(after, moved);
    session.end();
}

/// A program that another one includes shows its own cycles above its section. A temporary mistake does not change that; without its
/// section it becomes a part of the other program.
#[test]
fn included_programs_have_their_own_cycles() {
    let inner = ".input  x\n.output y\n.period\nperiod: fadd    y, x, x\n.if macro.longer\n        longer  y\n\
                 .endif\n        wait    period\n";
    let outer =
        ".macro  longer y\n        fmul    y, y, y\n        fmul    y, y, y\n.endm\n.include \"inner.s\"\n";
    let mut session = Session::new(&[("inner.s", inner), ("outer.s", outer)]);
    let lens = |session: &mut Session| {
        session.client.wait(|message| message["method"] == "workspace/inlayHint/refresh");
        let document = json!({ "textDocument": { "uri": session.uri("inner.s") } });
        let lenses = session.ask("textDocument/codeLens", document);
        lenses[0]["command"]["title"].as_str().unwrap().to_owned()
    };
    session.open("inner.s", inner);
    let own = lens(&mut session);
    let wrong = session.edit("inner.s", inner, "fadd", "fadf");
    assert!(session.told("inner.s").iter().any(|one| one["code"] == "unknown-instruction"));
    session.edit("inner.s", &wrong, "fadf", "fadd");
    assert_eq!(lens(&mut session), own);
    let [inner, outer] = ["inner.s", "outer.s"].map(|file| {
        let bound: Value =
            serde_json::from_str(&session.folder.line(&format!("bound {file} --json")).stdout).unwrap();
        let sections = bound["sections"].as_array().unwrap();
        let period = sections.iter().find(|section| section["name"] == "period").unwrap();
        period["cycles"]["worst"].as_u64().unwrap()
    });
    assert!(own.contains(&format!("period: {inner} cycles")), "{own}, {inner}");
    assert!(inner < outer, "{inner}, with the other's macro {outer}");
    session.end();
}

/// Pipeline view: cycles equal those of the inlay hints, and lines follow edits.
#[test]
fn the_picture_has_each_operation_at_its_line() {
    let mut session = Session::new(&[("main.s", MAIN), ("part.s", PART)]);
    session.open("main.s", MAIN);
    let told = session.client.wait(|message| message["method"] == "takt/counted");
    assert_eq!(told["params"]["uri"], session.uri("main.s"));
    let params = json!({ "textDocument": { "uri": session.uri("main.s") } });
    let picture = session.ask("takt/pipeline", params.clone());
    let trace = session.folder.line("analyse main.s --json").stdout;
    let trace: Value = serde_json::from_str(&trace).unwrap();
    let of_period = |bundle: &&Value| bundle["from"] == "period";
    let bundles = picture["bundles"].as_array().unwrap();
    // Operations of a straight-line block issue as in the run, relative to its first bundle.
    let ran = trace["bundles"].as_array().unwrap();
    let first = ran[0]["cycle"].as_u64().unwrap();
    let mut compared = 0;
    for (bundle, ran) in bundles.iter().filter(of_period).zip(ran) {
        assert_eq!(bundle["address"], ran["address"]);
        assert_eq!(bundle["cycle"].as_u64().unwrap() - 1, ran["cycle"].as_u64().unwrap() - first, "{bundle}");
        for (operation, ran) in
            bundle["operations"].as_array().unwrap().iter().zip(ran["operations"].as_array().unwrap())
        {
            for part in ["slot", "unit", "text", "latency"] {
                assert_eq!(operation[part], ran[part], "{part}");
            }
            let file = operation["file"].as_u64().unwrap() as usize;
            let uri = picture["files"][file].as_str().unwrap();
            let place =
                format!("{}:{}", uri.rsplit('/').next().unwrap(), operation["line"].as_u64().unwrap() + 1);
            assert_eq!(place, ran["place"].as_str().unwrap());
            compared += 1;
        }
    }
    assert!(compared > 3, "{picture:#}");
    session.edit("main.s", MAIN, ".schedule on\n", "\n\n.schedule on\n");
    let moved = session.ask("takt/pipeline", params);
    let line = |picture: &Value| {
        let all = picture["bundles"]
            .as_array()
            .unwrap()
            .iter()
            .flat_map(|bundle| bundle["operations"].as_array().unwrap());
        let here = session.uri("main.s");
        let lines = all.filter(|one| picture["files"][one["file"].as_u64().unwrap() as usize] == *here);
        lines.map(|one| one["line"].as_u64().unwrap()).collect::<Vec<_>>()
    };
    assert_eq!(line(&moved), line(&picture).iter().map(|line| line + 2).collect::<Vec<_>>());
    session.end();
}

/// A pipeline view of an older text is marked as such, even if the change is in an included file.
#[test]
fn the_picture_is_old_while_an_included_file_is_wrong() {
    let mut session = Session::new(&[("main.s", MAIN), ("part.s", PART)]);
    session.open("main.s", MAIN);
    session.open("part.s", PART);
    session.client.wait(|message| message["method"] == "takt/counted");
    let params = json!({ "textDocument": { "uri": session.uri("main.s") } });
    let picture = session.ask("takt/pipeline", params.clone());
    assert_eq!(picture["current"], true);
    let sections: Vec<_> =
        picture["sections"].as_array().unwrap().iter().map(|text| text.as_str().unwrap()).collect();
    assert!(
        sections[0].starts_with("period: ") && sections[0].contains(" cycles, lower bound "),
        "{sections:?}"
    );
    let wrong = session.edit("part.s", PART, "fmul    tmp", "fmull   tmp");
    let old = session.ask("takt/pipeline", params.clone());
    assert_eq!((&old["current"], &old["sections"]), (&json!(false), &picture["sections"]));
    session.edit("part.s", &wrong, "fmull   tmp", "fmul    tmp");
    assert_eq!(session.ask("takt/pipeline", params)["current"], true);
    session.end();
}

/// A mistake just after a correct change: the results for the previous text remain.
#[test]
fn a_mistake_soon_after_a_change_loses_no_cycles() {
    let mut session = Session::new(&[("main.s", MAIN), ("part.s", PART), ("other.s", MAIN)]);
    session.open("main.s", MAIN);
    session.client.wait(|message| message["method"] == "takt/counted");
    let params = json!({ "textDocument": { "uri": session.uri("main.s") } });
    let changed = session.edit("main.s", MAIN, "1, 3", "1, 2");
    session.ask("takt/pipeline", params.clone());
    session.edit("main.s", &changed, "fadd    F", "fad     F");
    assert_eq!(session.ask("takt/pipeline", params.clone())["current"], false);
    // Several programs wait to be scheduled at the same time.
    session.open("other.s", MAIN);
    let other = session.uri("other.s");
    session.client.wait(|message| message["method"] == "takt/counted" && message["params"]["uri"] == *other);
    assert_eq!(session.ask("takt/pipeline", params)["current"], false);
    session.end();
}

#[test]
fn completion_offers_valid_operands() {
    let mut session = Session::new(&[("main.s", MAIN), ("part.s", PART)]);
    session.open("main.s", MAIN);
    let mut labels = |from: &str, to: &str| -> Vec<String> {
        let text = session.edit("main.s", MAIN, from, to);
        let marked = to.trim_end();
        let at = json!({ "textDocument": { "uri": session.uri("main.s") }, "position": position(&text, marked, marked.len()) });
        let items = session.ask("textDocument/completion", at)["items"].as_array().unwrap().clone();
        session.edit("main.s", &text, to, from);
        items.iter().map(|item| item["label"].as_str().unwrap().to_owned()).collect()
    };
    let has = |labels: &[String], yes: &[&str], no: &[&str]| {
        let is = |name: &&&str| labels.iter().any(|label| label == **name);
        let (missing, wrong): (Vec<_>, Vec<_>) =
            (yes.iter().filter(|name| !is(name)).collect(), no.iter().filter(is).collect());
        assert!(missing.is_empty() && wrong.is_empty(), "{labels:?}: missing {missing:?}, wrong {wrong:?}");
    };
    has(&labels("        fadd    F, p1, p2\n", "        fa\n"), &["fadd", "scale", ".reg"], &["p1", "K"]);
    has(&labels("fadd    F, p1", "fadd    F"), &["F", "p1"], &["x", "K", "fadd", "period"]);
    has(
        &labels("F, p1, p2\n", "F, p1, p\n"),
        &["p2", "x", "K", "sqrt", "pi"],
        &["i", "period", "tmp", "fadd"],
    );
    // Functions of equations; others are of constants only, and say so.
    has(
        &labels("fadd    F, p1, p2\n", "F = s\n"),
        &["sat", "sign", "sum", "scale", "sqrt", "tan"],
        &["fadd"],
    );
    // An instruction that there is not may be a macro yet to be written.
    has(&labels("fadd    F, p1, p2\n", "fadx    F, p\n"), &["p1", "p2", "x", "K", "sqrt"], &["fadd"]);
    has(&labels("p{i}, 2\n", "p{i}, \n"), &["i", "p2", "K"], &["fadd"]);
    has(&labels("wait    period\n", "wait    pe\n"), &["period"], &["p1", "K"]);
    has(&labels("n:int\n", "n:i\n"), &["int", "float", "bits"], &["p1"]);
    has(&labels(".schedule on\n", ".schedule o\n"), &["on", "off"], &["p1"]);
    has(&labels(".include \"part.s\"\n", ".include <\n"), &["math.s"], &["part.s"]);
    session.end();
}

/// Names are known in the operands of an instruction that there is not.
#[test]
fn operands_of_an_unknown_instruction_are_followed() {
    let mut session = Session::new(&[("main.s", MAIN), ("part.s", PART)]);
    session.open("main.s", MAIN);
    let text = session.edit("main.s", MAIN, "fadd    F, p1, p2\n", "fadx    F, p1, p2\n");
    session.told("main.s");
    let mut place = session.at("main.s", &text, "fadx    F");
    place["position"]["character"] = (place["position"]["character"].as_u64().unwrap() + 8).into();
    let hover = session.ask("textDocument/hover", place.clone());
    assert!(hover["contents"]["value"].as_str().unwrap().starts_with("**F**: output port"), "{hover}");
    let definition = session.ask("textDocument/definition", place.clone());
    assert_eq!(definition[0]["range"]["start"], position(&text, ".output F", 8), "{definition}");
    // The unknown instruction itself is no name.
    let mnemonic = session.at("main.s", &text, "fadx");
    assert_eq!(session.ask("textDocument/hover", mnemonic), Value::Null);
    session.end();
}

#[test]
fn a_document_is_laid_out_as_by_fmt() {
    let mut session = Session::new(&[]);
    let messy = ".input x;\u{b5}\n.output F\n.period\np: fmul F,x , 2 ;twice\n  wait p\n\n\n";
    session.folder.write("messy.s", messy);
    session.open("messy.s", messy);
    let params = json!({ "textDocument": { "uri": session.uri("messy.s") }, "options": { "tabSize": 8, "insertSpaces": true } });
    let edits = session.ask("textDocument/formatting", params);
    let mut lines: Vec<String> = messy.split('\n').map(str::to_owned).collect();
    for edit in edits.as_array().unwrap().iter().rev() {
        let (start, end) = (&edit["range"]["start"], &edit["range"]["end"]);
        let (first, last) =
            (start["line"].as_u64().unwrap() as usize, end["line"].as_u64().unwrap() as usize);
        let cut = |line: &str, at: &Value, head: bool| {
            let units: Vec<u16> = line.encode_utf16().collect();
            let at = at["character"].as_u64().unwrap() as usize;
            String::from_utf16(if head { &units[..at] } else { &units[at..] }).unwrap()
        };
        let new = cut(&lines[first], start, true)
            + edit["newText"].as_str().unwrap()
            + &cut(&lines[last], end, false);
        lines.splice(first..=last, new.split('\n').map(str::to_owned));
    }
    session.folder.line("fmt messy.s").ok();
    assert_eq!(lines.join("\n"), session.folder.read_text("messy.s"));
    assert_eq!(session.folder.line("fmt --check messy.s").status, Some(0));
    session.folder.write("messy.s", messy);
    let done = session.folder.line("fmt --check messy.s");
    assert_eq!((done.status, done.stdout.as_str()), (Some(1), "messy.s\n"));
    assert_eq!(session.folder.read_text("messy.s"), messy);
    session.end();
}

/// Malformed messages, unknown methods, missing documents: each gives an error, and the session continues.
#[test]
fn survives_and_reports_invalid_messages() {
    let folder = Folder::new();
    let mut client = Client::start(&folder, "lsp");
    let code = |answer: &Value| answer["error"]["code"].as_i64().unwrap_or_else(|| panic!("{answer}"));
    assert_eq!(code(&client.ask("textDocument/hover", json!({}))), -32002, "before it is initialised");
    client.ask("initialize", json!({ "capabilities": {} }));
    client.raw(b"Content-Length: 7\r\n\r\n{{not]}");
    assert_eq!(code(&client.receive()), -32700);
    client.send(&json!({ "jsonrpc": "2.0", "result": [] }));
    assert_eq!(code(&client.receive()), -32600);
    client.send(&json!([]));
    assert_eq!(code(&client.receive()), -32600);
    assert_eq!(code(&client.ask("initialize", json!({ "capabilities": {} }))), -32600);
    assert_eq!(code(&client.ask("textDocument/dance", json!({}))), -32601);
    assert_eq!(code(&client.ask("textDocument/hover", json!({ "position": 7 }))), -32602);
    let nowhere = json!({ "textDocument": { "uri": "file:///nowhere/x.s" }, "position": { "line": 0, "character": 0 } });
    let answer = client.ask("textDocument/hover", nowhere.clone());
    assert_eq!(answer["error"]["message"], "`file:///nowhere/x.s` is not open");
    let change =
        json!({ "textDocument": { "uri": "file:///nowhere/x.s", "version": 2 }, "contentChanges": [] });
    client.notify("textDocument/didChange", change);
    let logged = client.wait(|message| message["method"] == "window/logMessage");
    assert!(logged["params"]["message"].as_str().unwrap().contains("is not open"));
    client.notify("textDocument/didOpen", json!("what?"));
    client.wait(|message| message["method"] == "window/logMessage");

    // A document without a file, and one whose file does not exist.
    for uri in ["untitled:Untitled-1", "file:///nowhere/new.s"] {
        let document =
            json!({ "uri": uri, "languageId": "takt", "version": 1, "text": ".period\np: wait q\n" });
        client.notify("textDocument/didOpen", json!({ "textDocument": document }));
        let told = client.wait(|message| message["params"]["uri"] == uri);
        assert_eq!(told["params"]["diagnostics"][0]["code"], "unknown-name", "{told}");
    }
    // Positions beyond the end of the text, in every request that has a position.
    for method in ["hover", "completion", "definition", "documentHighlight", "prepareRename"] {
        let params = json!({ "textDocument": { "uri": "untitled:Untitled-1" }, "position": { "line": 4_000_000, "character": 4_000_000 } });
        let answer = client.ask(&format!("textDocument/{method}"), params);
        assert!(answer.get("result").is_some() || code(&answer) == -32803, "{answer}");
    }
    // Larger than the assembler's limit: 65 MiB.
    let huge = "; \n".repeat((65 << 20) / 3);
    let document = json!({ "uri": "untitled:huge", "languageId": "takt", "version": 1, "text": huge });
    client.notify("textDocument/didOpen", json!({ "textDocument": document }));
    let told = client.wait(|message| message["params"]["uri"] == "untitled:huge");
    let text = told["params"]["diagnostics"][0]["message"].as_str().unwrap().to_owned();
    assert!(text.contains("more than the 67108864 bytes"), "{text}");

    assert_eq!(client.ask("shutdown", Value::Null)["result"], Value::Null);
    assert_eq!(code(&client.ask("textDocument/hover", nowhere)), -32600);
    client.notify("exit", Value::Null);
    assert_eq!(client.end(), (Some(0), String::new()));

    // A malformed and a truncated stream: failure without a panic.
    let mut client = Client::start(&folder, "lsp");
    client.raw(b"GET / HTTP/1.1\n");
    let (status, stderr) = client.end();
    assert_eq!(status, Some(1));
    assert!(stderr.contains("begins with `Content-Length: …`") || stderr.contains("header"), "{stderr}");
}

/// A request that is cancelled before its answer.
#[test]
fn cancelled_requests_are_not_answered() {
    let mut session = Session::new(&[("main.s", MAIN), ("part.s", PART)]);
    session.open("main.s", MAIN);
    let hover = |id: i64| {
        json!({ "jsonrpc": "2.0", "id": id, "method": "textDocument/hover", "params": session.at("main.s", MAIN, "fadd") }).to_string()
    };
    let cancel =
        json!({ "jsonrpc": "2.0", "method": "$/cancelRequest", "params": { "id": 900 } }).to_string();
    // Send all messages in one write after a slow request, so that the cancellation arrives before its request is handled.
    let frames: String = [hover(899), hover(900), cancel]
        .iter()
        .map(|text| format!("Content-Length: {}\r\n\r\n{text}", text.len()))
        .collect();
    session.client.raw(frames.as_bytes());
    let answer = session.client.wait(|message| message["id"] == 900);
    // The request may be answered before the second frame is read; otherwise it is cancelled.
    assert!(answer["error"]["code"] == -32800 || answer.get("result").is_some(), "{answer}");
    session.end();
}

const GNU: &str = "\t.file \"a.c\"\n\t.text\n\t.globl main\nmain:\n\tret\n";

/// Editors take `.tks` and what is written in Takt for sources, and leave GNU's assembly alone.
#[test]
fn editors_leave_other_assemblers_alone() {
    let folder = Folder::new();
    folder.write("gnu.s", GNU);
    folder.write("takt.s", MAIN);
    folder.write("own.tks", "; nothing yet\n");
    let editors = concat!(env!("CARGO_MANIFEST_DIR"), "/../editors");
    let path = |name: &str| folder.path().join(name);
    for (file, is_own) in [("gnu.s", false), ("takt.s", true), ("own.tks", true)] {
        let output = Command::new("nvim")
            .args([
                "--headless",
                "--clean",
                "-n",
                "--cmd",
                "filetype on",
                "--cmd",
                "lua vim.lsp.start = nil; vim.lsp.start_client = function() end",
            ])
            .args(["--cmd", &format!("luafile {editors}/neovim/takt.lua")])
            .arg(path(file))
            .args(["-c", "lua io.stdout:write(vim.bo.filetype)", "-c", "qall!"])
            .env("XDG_STATE_HOME", folder.path())
            .output()
            .expect("nvim is there: `cargo xtask test` installs it");
        let found = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(
            found == "takt",
            is_own,
            "Neovim, {file}: {found} {}",
            String::from_utf8_lossy(&output.stderr)
        );
        let output = Command::new("emacs")
            .args(["--batch", "-L", &format!("{editors}/emacs"), "--eval", "(require 'takt)"])
            .arg(format!("--visit={}", path(file).display()))
            .args(["--eval", "(princ major-mode)"])
            .output()
            .expect("emacs is there: `cargo xtask test` installs it");
        let found = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(
            found == "takt-mode",
            is_own,
            "Emacs, {file}: {found} {}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
    // One list of directives in the three, each of them one of Takt's.
    let listed = |file: &str| -> Vec<String> {
        let text = std::fs::read_to_string(format!("{editors}/{file}")).unwrap();
        let line =
            text.lines().find(|line| line.contains("period") && line.contains("endfor")).expect("the list");
        let line = &line[line.find("period").unwrap()..line.find("endfor").unwrap() + "endfor".len()];
        let words = line.replace('\\', "");
        let names = takt_asm::Directive::ALL.iter().map(|directive| &directive.name()[1..]);
        let found =
            names.filter(|name| words.split(|c: char| !c.is_alphanumeric()).any(|word| word == *name));
        let mut found: Vec<String> = found.map(str::to_owned).collect();
        found.sort();
        assert_eq!(found.len(), line.matches('|').count() + 1, "{file}: {line}");
        found
    };
    let lists = ["neovim/takt.lua", "emacs/takt.el", "vscode/src/recognise.ts"].map(listed);
    assert!(lists.iter().all(|list| *list == lists[0]), "{lists:?}");
    let helix = std::fs::read_to_string(format!("{editors}/helix/languages.toml")).unwrap();
    assert!(helix.contains("file-types = [\"tks\"]"), "{helix}");
    // The path that its first lines name exists in a copy of Takt.
    let grammar =
        helix.lines().find_map(|line| line.split_once("/path/to/takt/")).expect("the grammar's path");
    let grammar = grammar.1.trim_end_matches(&['"', ' ', '}'][..]);
    assert!(std::path::Path::new(editors).join("../..").join(grammar).is_dir(), "{grammar}");
}

/// Neovim without a screen and without a user's files, which are in a folder; a script leaves what it found in the file `OUT`.
fn neovim(folder: &Folder) -> Command {
    let mut command = Command::new("nvim");
    command.args(["--headless", "--clean", "-n"]).current_dir(folder.path());
    command.env("OUT", folder.path().join("found.json"));
    command.env("XDG_STATE_HOME", folder.path()).env("XDG_CACHE_HOME", folder.path());
    command
}

/// Runs Neovim; returns what its script found, and the standard error.
fn found_by(command: &mut Command, folder: &Folder) -> (Value, String) {
    let output = command.output().expect("nvim is there: `cargo xtask test` installs it");
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    (serde_json::from_str(&folder.read_text("found.json")).unwrap(), stderr)
}

/// With the shipped configuration, Neovim shows the cycles beside the lines and above the sections: before 0.10 it has no inlay hints of its
/// own.
#[test]
fn neovim_shows_the_cycles() {
    let folder = Folder::new();
    folder.write(
        "gains.s",
        std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../programs/examples/gains.s")).unwrap(),
    );
    let binary = Path::new(env!("CARGO_BIN_EXE_takt")).parent().unwrap();
    let path = format!("{}:{}", binary.display(), std::env::var("PATH").unwrap());
    let configuration = concat!(env!("CARGO_MANIFEST_DIR"), "/../editors/neovim/takt.lua");
    let script = r"
        local found = {}
        vim.wait(60000, function()
          local space = vim.api.nvim_get_namespaces().takt
          found.lenses = vim.tbl_map(function(one) return one.command and one.command.title end, vim.lsp.codelens.get(0))
          found.hints = {}
          for _, mark in ipairs(vim.api.nvim_buf_get_extmarks(0, space, 0, -1, { details = true })) do
            table.insert(found.hints, (mark[2] + 1) .. mark[4].virt_text[1][1])
          end
          found.keys = vim.tbl_filter(function(key) return vim.fn.maparg(key, 'n') ~= '' end, { 'K', 'gd', 'grr', 'grn', 'gra', 'gO' })
          return #found.lenses > 0 and (#found.hints > 0 or vim.lsp.inlay_hint ~= nil)
        end, 100)
        vim.fn.writefile({ vim.fn.json_encode(found) }, vim.env.OUT)
        vim.cmd('qall!')";
    folder.write("look.lua", script);
    let mut command = neovim(&folder);
    command.args(["-c", "filetype on", "-c", &format!("luafile {configuration}")]);
    command.args(["-c", "edit gains.s", "-c", "luafile look.lua"]).env("PATH", path);
    let (found, stderr) = found_by(&mut command, &folder);
    let all = |name: &str| {
        found[name].as_array().unwrap().iter().filter_map(Value::as_str).collect::<Vec<_>>().join("; ")
    };
    assert!(all("lenses").contains("period: 33 cycles, lower bound 33"), "{found}\n{stderr}");
    assert!(all("hints").is_empty() || all("hints").contains("28  6 · mul, 11 · add"), "{found}\n{stderr}");
    assert_eq!(all("keys"), "K; gd; grr; grn; gra; gO", "{found}\n{stderr}");
}

/// Neovim's built-in client, from the first keystroke to the end.
#[test]
fn neovim_uses_the_language_server() {
    let folder = Folder::new();
    for name in ["tracking.s", "robot.s"] {
        folder.write(name, std::fs::read(source(name)).unwrap());
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/clients/nvim_lsp.lua");
    let mut command = neovim(&folder);
    command.args(["-c", &format!("luafile {script}")]);
    command.env("TAKT", env!("CARGO_BIN_EXE_takt")).env("FILE", folder.path().join("tracking.s"));
    let (found, stderr) = found_by(&mut command, &folder);
    assert_eq!(found.get("problem"), None, "{found}\n{stderr}");
    let text = |name: &str| found[name].as_str().unwrap_or_else(|| panic!("{name}: {found}")).to_owned();
    let (slot, unit) = T3.host(Function::Multiply).unwrap();
    let (slot, Unit { name, latency, interval, .. }) = (T3.slot(slot).name, unit);
    let hover = format!("slot `{slot}`, unit `{name}`, latency {latency}, interval {interval}");
    assert!(text("hover").contains(&hover), "{found}");
    assert_eq!(found["diagnostic"]["code"], "unknown-instruction");
    assert!(found["diagnostic"]["message"].as_str().unwrap().contains("did you mean `fmul`?"));
    assert_eq!(
        (text("fix"), text("fixed")),
        ("write `fmul`".to_owned(), "        fmul    zz, z, z".to_owned())
    );
    assert_eq!(text("definition"), "robot.s");
    assert!(found["symbols"].as_u64().unwrap() > 50 && found["folds"].as_u64().unwrap() > 10);
    let lenses = found["lenses"].as_array().unwrap();
    let period = lenses.iter().filter_map(Value::as_str).find(|title| title.starts_with("period: ")).unwrap();
    assert!(period.contains("cycles, lower bound ") && period.contains(", deadline kept by 12,"), "{period}");
    assert!(found["hints"].as_u64().unwrap() > 80);
    assert!(text("hint").ends_with(&format!(" · {slot}")), "{found}");
    assert!(text("refused").contains("is declared already"), "{found}");
    assert_eq!(text("formatted"), "        fmul    zz, z, z");
    assert_eq!(found["stopped"], true);
    // The edited source assembles to the same program.
    let code = |file: &str| -> Vec<String> {
        let done = folder.line(&format!("asm {file} --strip --readmemh memory -l -"));
        assert_eq!(done.status, Some(0), "{}", done.stderr);
        let mut files = std::fs::read_dir(folder.path().join("memory"))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect::<Vec<_>>();
        files.sort();
        files.iter().map(|file| std::fs::read_to_string(file).unwrap()).collect()
    };
    let renamed = folder.read_text("tracking.s");
    assert!(
        renamed.contains("pos{i}")
            && renamed.contains("slider")
            && folder.read_text("robot.s").contains("slider")
    );
    assert_eq!(code("tracking.s"), code(&source("tracking.s")));
}

/// Signature help names the operand that is typed: of instructions, macros, functions and directives.
#[test]
fn operands_are_shown_in_their_order() {
    let mut session = Session::new(&[("main.s", MAIN), ("part.s", PART)]);
    session.open("main.s", MAIN);
    let mut told = |from: &str, to: &str| {
        let text = session.edit("main.s", MAIN, from, to);
        let at = json!({ "textDocument": { "uri": session.uri("main.s") }, "position": position(&text, to, to.len()) });
        let help = session.ask("textDocument/signatureHelp", at);
        session.edit("main.s", &text, to, from);
        let Some(signature) = help["signatures"].get(0) else { return String::new() };
        let label: Vec<u16> = signature["label"].as_str().unwrap().encode_utf16().collect();
        let active = help["activeParameter"].as_u64().unwrap() as usize;
        let range = signature["parameters"][active]["label"].as_array().cloned().unwrap_or_default();
        let range: Vec<usize> = range.iter().map(|end| end.as_u64().unwrap() as usize).collect();
        let operand = if let [from, to] = range[..] { &label[from..to] } else { &[] };
        format!("{} | {}", String::from_utf16(&label).unwrap(), String::from_utf16(operand).unwrap())
    };
    assert_eq!(told("fadd    F, p1, p2", "fadd    F, p1, "), "fadd d, a, b | b");
    assert_eq!(told("fadd    F, p1, p2", "fadd "), "fadd d, a, b | d");
    assert_eq!(told("scale   p{i}, 2", "scale   p{i}, "), "scale to, by | by");
    assert_eq!(told("fadd    F, p1, p2", "F = p1 + max(p2, "), "max(a, b) | b");
    assert_eq!(told("fadd    F, p1, p2", "F = sat(p1, "), "sat(a, b) | b");
    assert_eq!(told("fadd    F, p1, p2", "F = sum(k, 1, "), "sum(i, first, last, part) | last");
    assert_eq!(told(".rep i, 1, 3", ".rep i, max(1, "), "max(a, …) | …");
    assert_eq!(told("fadd    F, p1, p2", "F = p1 + sqrt(max(p2, 1) + "), "sqrt(a) | a");
    assert!(told(".rep i, 1, 3", ".rep i, ").starts_with(".rep "));
    assert_eq!(told("fadd    F, p1, p2", "fadd"), "", "before a blank, completion helps");
    assert_eq!(told("fadd    F, p1, p2", "; fadd F, "), "");
    session.end();
}

/// Links, names of all programs, selections and formatting at the end of a line.
#[test]
fn places_are_linked_found_and_selected() {
    let mut session = Session::new(&[("main.s", MAIN), ("part.s", PART)]);
    session.open("main.s", MAIN);
    let document = json!({ "uri": session.uri("main.s") });
    let links = session.ask("textDocument/documentLink", json!({ "textDocument": document }));
    assert_eq!(links[0]["target"], *session.uri("part.s"));
    assert_eq!(links.as_array().unwrap().len(), 1);

    let names = |found: &Value| -> Vec<String> {
        found.as_array().unwrap().iter().map(|one| one["name"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(names(&session.ask("workspace/symbol", json!({ "query": "SCL" }))), ["scale"]);
    let all = names(&session.ask("workspace/symbol", json!({ "query": "" })));
    assert!(
        ["F", "K", "p{i}", "never", "period"].iter().all(|name| all.iter().any(|one| one == name)),
        "{all:?}"
    );

    let at = position(MAIN, "i*K", 1);
    let chain =
        session.ask("textDocument/selectionRange", json!({ "textDocument": document, "positions": [at] }));
    let (mut selected, mut next) = (Vec::new(), &chain[0]);
    let lines: Vec<&str> = MAIN.split('\n').collect();
    while !next.is_null() {
        let (start, end) = (&next["range"]["start"], &next["range"]["end"]);
        let (first, last) =
            (start["line"].as_u64().unwrap() as usize, end["line"].as_u64().unwrap() as usize);
        let column = |at: &Value| at["character"].as_u64().unwrap() as usize;
        selected.push(match first == last {
            true => lines[first][column(start)..column(end)].to_owned(),
            false => format!("{} … {}", lines[first], lines[last]),
        });
        next = &next["parent"];
    }
    let wanted = ["i", "i*K", "fmul    p{i}, x, i*K", "        fmul    p{i}, x, i*K", ".rep i, 1, 3 … .endr"];
    assert_eq!(selected[..5], wanted);
    assert_eq!(selected.last().unwrap(), ".include \"part.s\" … ");

    let text = session.edit("main.s", MAIN, "        fadd    F, p1, p2\n", "fadd F,p1 ,p2\n");
    let line = position(&text, "fadd F,p1", 0)["line"].as_u64().unwrap();
    let edits = session.ask(
        "textDocument/onTypeFormatting",
        json!({
            "textDocument": document, "position": { "line": line + 1, "character": 0 }, "ch": "\n",
            "options": { "tabSize": 8, "insertSpaces": true },
        }),
    );
    assert_eq!(edits.as_array().unwrap().len(), 1);
    assert_eq!(edits[0]["newText"], "        fadd    F, p1, p2");
    session.end();
}
