// SPDX-License-Identifier: MIT OR Apache-2.0
//! Compilation with Verilator, cached: builds a program from a circuit in Verilog and a driver in C++, and stores it under a hash of all
//! sources and options.
//!
//! Verilator's run-time library takes longer to compile than most circuits, so it is compiled once for all programs.

use std::collections::BTreeMap;
use std::collections::hash_map::DefaultHasher;
use std::fs;
use std::hash::{Hash, Hasher};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use thiserror::Error;

/// Reason why a program cannot be built.
#[derive(Debug, Error)]
pub enum VerilatorError {
    /// A tool is not installed.
    #[error("{tool} is not installed; on Debian: apt-get install {package}")]
    Missing {
        /// Name of the program.
        tool: &'static str,
        /// Debian package that contains it.
        package: &'static str,
    },
    /// A tool failed, with its output.
    #[error("{tool} failed:\n{text}")]
    Tool {
        /// Name of the program.
        tool: &'static str,
        /// Standard output and error.
        text: String,
    },
    /// A file cannot be written or read.
    #[error("{path}: {source}")]
    File {
        /// Path of the file.
        path: String,
        /// Error of the file system.
        source: std::io::Error,
    },
    /// No folder for the cache is available.
    #[error(transparent)]
    Cache(#[from] takt_cache::CacheError),
}

/// Sources and options of a program.
#[derive(Debug)]
pub struct Sources<'a> {
    /// Prefix of the program's file name.
    pub name: &'a str,
    /// Module name of the top.
    pub top: &'a str,
    /// Prefix of the classes that Verilator generates.
    pub prefix: &'static str,
    /// Verilog files by name.
    pub files: Vec<(&'a str, &'a str)>,
    /// Main program, in C++.
    pub driver: &'a str,
    /// C++ headers of the driver, by name.
    pub headers: Vec<(&'a str, &'a str)>,
    /// Further arguments for Verilator.
    pub arguments: Vec<String>,
    /// Further arguments for the driver's compiler.
    pub defines: Vec<String>,
    /// Optimisation level of the C++ compiler: `-O1` where the program runs for seconds, otherwise `-O2`.
    pub optimise: &'static str,
    /// The program can write waveforms; the driver is compiled with `TRACE` defined.
    pub trace: bool,
}

fn file_error(path: &Path) -> impl FnOnce(std::io::Error) -> VerilatorError {
    let path = path.display().to_string();
    move |source| VerilatorError::File { path, source }
}

fn run(tool: &'static str, package: &'static str, command: &mut Command) -> Result<String, VerilatorError> {
    let output = command.output().map_err(|error| match error.kind() {
        ErrorKind::NotFound => VerilatorError::Missing { tool, package },
        _ => VerilatorError::Tool { tool, text: error.to_string() },
    })?;
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    if output.status.success() {
        Ok(text.into_owned())
    } else {
        Err(VerilatorError::Tool { tool, text: text.into_owned() })
    }
}

fn verilator() -> Command {
    Command::new("verilator")
}

/// Runs `make` unless `path` already holds its complete result; a lock per path prevents parallel runs in this process. The result is a
/// folder with a file of the same name and the file's checksum. Other processes may make it at the same time, so the folder is renamed to
/// `path` when it is complete.
fn once(
    path: &Path,
    make: impl FnOnce(&Path) -> Result<(), VerilatorError>,
) -> Result<PathBuf, VerilatorError> {
    static BEING_MADE: Mutex<BTreeMap<PathBuf, Arc<Mutex<()>>>> = Mutex::new(BTreeMap::new());
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    let own = {
        let mut all = BEING_MADE.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(all.entry(path.to_owned()).or_default())
    };
    let _one = own.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(name) = path.file_name() else { return Err(file_error(path)(ErrorKind::InvalidInput.into())) };
    let kept = path.join(name);
    if takt_cache::is_whole(&kept) {
        return Ok(kept);
    }
    takt_cache::discard(path);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let partial = format!("{}.{}.{number}.partial", path.display(), std::process::id());
    let partial = Path::new(&partial);
    let whole = partial.join("whole");
    fs::create_dir_all(&whole).map_err(file_error(partial))?;
    let made = make(partial).and_then(|()| {
        let program = whole.join(name);
        fs::rename(partial.join("made"), &program)
            .and_then(|()| takt_cache::seal_program(&program))
            .and_then(|()| fs::rename(&whole, path))
            // Another process may have been faster.
            .or_else(|error| if takt_cache::is_whole(&kept) { Ok(()) } else { Err(error) })
            .map_err(file_error(path))
    });
    takt_cache::discard(partial);
    made.map(|()| kept)
}

/// Options of all C++ compilations, which must agree between circuit and run-time library.
fn options(include: &Path, optimise: &str, trace: bool) -> Vec<String> {
    let trace = u8::from(trace);
    let mut options = vec![optimise.to_owned(), "-std=gnu++17".to_owned(), "-faligned-new".to_owned()];
    options.extend(["-pthread".to_owned(), "-w".to_owned()]);
    options.extend(
        ["VERILATOR=1", "VM_COVERAGE=0", "VM_SC=0", "VM_TRACE_FST=0"].map(|name| format!("-D{name}")),
    );
    options.extend([format!("-DVM_TRACE={trace}"), format!("-DVM_TRACE_VCD={trace}")]);
    options.extend([include.to_owned(), include.join("vltstd")].map(|path| format!("-I{}", path.display())));
    options
}

impl Sources<'_> {
    /// Builds the program in a folder, or finds an earlier build there.
    ///
    /// # Errors
    /// If Verilator or a C++ compiler is missing or fails.
    pub fn build(&self, folder: &Path) -> Result<PathBuf, VerilatorError> {
        let version = run("verilator", "verilator", verilator().arg("--version"))?;
        let mut hasher = DefaultHasher::new();
        (&version, self.top, self.prefix, &self.files, self.driver, &self.headers).hash(&mut hasher);
        (&self.arguments, &self.defines, self.optimise, self.trace).hash(&mut hasher);
        let program = folder.join(format!("{}-{:016x}", self.name, hasher.finish()));
        once(&program, |work| self.compile(work, folder, &version))
    }

    fn compile(&self, work: &Path, folder: &Path, version: &str) -> Result<(), VerilatorError> {
        let write = |name: &str, text: &str| {
            let path = work.join(name);
            let parent = path.parent().unwrap_or(work);
            fs::create_dir_all(parent).map_err(file_error(parent))?;
            fs::write(&path, text).map_err(file_error(&path))
        };
        for (name, text) in self.files.iter().chain(&self.headers) {
            write(name, text)?;
        }
        write("driver.cpp", self.driver)?;
        // X becomes random, since registers that the circuit does not initialise must not matter.
        let mut command = verilator();
        command.current_dir(work).args(["--cc", "-O3", "--x-assign", "unique", "--x-initial", "unique"]);
        command.args(["--prefix", self.prefix, "--top-module", self.top, "--Mdir", "obj"]);
        command.args(self.trace.then_some("--trace")).args(&self.arguments);
        command.args(self.files.iter().map(|(name, _)| name).filter(|name| name.ends_with(".v")));
        run("verilator", "verilator", &mut command)?;
        let root = run("verilator", "verilator", verilator().args(["--getenv", "VERILATOR_ROOT"]))?;
        let include = Path::new(root.trim()).join("include");
        let options = options(&include, self.optimise, self.trace);
        let classes = work.join("obj").join(format!("{}_classes.mk", self.prefix));
        let classes = fs::read_to_string(&classes).map_err(file_error(&classes))?;

        // Each file that Verilator has written reads headers for longer than its own text, so two units take half of the time.
        let unit = |suffix: &str, last: &str| -> String {
            let own = ["CLASSES", "SUPPORT"].map(|kind| format!("VM_{kind}_{suffix}"));
            let parts = own.iter().flat_map(|name| listed(&classes, name));
            parts.map(|part| format!("#include \"obj/{part}.cpp\"\n")).chain([last.to_owned()]).collect()
        };
        write("fast.cpp", &unit("FAST", "#include \"driver.cpp\"\n"))?;
        write("slow.cpp", &unit("SLOW", ""))?;
        let compile = |unit: &str, optimise: &str| {
            let mut compiler = Command::new("c++");
            compiler.current_dir(work).args(&options).arg(optimise).args(&self.defines);
            compiler.args(["-I.", "-Iobj"]).args(self.trace.then_some("-DTRACE"));
            run("c++", "g++", compiler.args(["-c", &format!("{unit}.cpp"), "-o", &format!("{unit}.o")]))
        };
        std::thread::scope(|scope| {
            let slow = scope.spawn(|| compile("slow", "-O0"));
            let fast = compile("fast", self.optimise);
            let slow = slow.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            fast.and(slow)
        })?;
        let mut linker = Command::new("c++");
        linker.current_dir(work).args(&options).args(&self.defines).args(["fast.o", "slow.o"]);
        for part in ["VM_GLOBAL_FAST", "VM_GLOBAL_SLOW"].iter().flat_map(|name| listed(&classes, name)) {
            linker.arg(runtime(folder, version, &include, part, &options)?);
        }
        run("c++", "g++", linker.args(["-o", "made"]))?;
        Ok(())
    }
}

/// Files of a list in the makefile that Verilator has written.
fn listed<'a>(classes: &'a str, name: &str) -> impl Iterator<Item = &'a str> {
    let lines = classes.lines().map(str::trim);
    let list =
        lines.skip_while(move |line| !line.strip_prefix(name).is_some_and(|rest| rest.starts_with(" +=")));
    let files = list.skip(1).map(|line| line.trim_end_matches('\\').trim());
    files.take_while(|file| !file.is_empty() && !file.starts_with('#'))
}

/// Compiles a part of the run-time library, once.
fn runtime(
    folder: &Path,
    version: &str,
    include: &Path,
    part: &str,
    options: &[String],
) -> Result<PathBuf, VerilatorError> {
    let mut hasher = DefaultHasher::new();
    (version, options).hash(&mut hasher);
    once(&folder.join(format!("{part}-{:016x}.o", hasher.finish())), |work| {
        let mut compiler = Command::new("c++");
        compiler.current_dir(work).args(options).arg("-c").arg(include.join(format!("{part}.cpp")));
        run("c++", "g++", compiler.args(["-o", "made"])).map(drop)
    })
}

/// Fault to plant in a circuit: file, an expression or right-hand side that occurs once in it, and its replacement.
pub type Fault<'a> = (&'a str, &'a str, &'a str);

/// Plants many faults in one circuit, each behind a multiplexer. A simulation selects one by the argument `+fault=`, from 1; without it,
/// the circuit behaves as before. `top` is the module of the top, in one of the files.
///
/// # Errors
/// A message, if an expression does not occur exactly once.
pub fn plant(files: &mut [crate::export::DesignFile], top: &str, faults: &[Fault<'_>]) -> Result<(), String> {
    for (number, (name, from, to)) in (1..).zip(faults) {
        let own = |file: &&mut crate::export::DesignFile| {
            file.name == *name || file.name.rsplit('/').next() == Some(&format!("{name}.v"))
        };
        let file = files.iter_mut().find(own).ok_or_else(|| format!("there is no file {name}"))?;
        // The right-hand side of an assignment becomes the choice.
        let (head, from) = from.split_once("<= ").map_or(("", *from), |(head, from)| (head, from));
        let to = to.split_once("<= ").map_or(*to, |(_, to)| to);
        let head = if head.is_empty() { String::new() } else { format!("{head}<= ") };
        let place = format!("{head}{from}");
        if file.text.matches(&place).count() != 1 {
            return Err(format!("`{place}` must occur once in {name}"));
        }
        let choice = format!("{head}({top}.planted == {number} ? ({to}) : ({from}))");
        file.text = file.text.replace(&place, &choice);
    }
    let module = format!("module {top} ");
    let own = |file: &&mut crate::export::DesignFile| file.text.contains(&module);
    let file = files.iter_mut().find(own).ok_or_else(|| format!("there is no module {top}"))?;
    let planted =
        ");\n\n    integer planted;\n    initial if (!$value$plusargs(\"fault=%d\", planted)) planted = 0;\n";
    let at = file.text.find(&module).unwrap_or(0);
    let (before, own) = file.text.split_at(at);
    file.text = format!("{before}{}", own.replacen(");\n", planted, 1));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{listed, once};
    use std::cell::Cell;
    use std::fs;
    use std::path::Path;

    #[test]
    fn files_of_a_makefile_are_listed() {
        let text = "VM_CLASSES_FAST += \\\n\tVtop \\\n\nVM_GLOBAL_FAST += \\\n\tverilated \\\n\tverilated_threads \\\n\n\
                    # Generated\nVM_GLOBAL_SLOW += \\\n\n";
        assert_eq!(listed(text, "VM_CLASSES_FAST").collect::<Vec<_>>(), ["Vtop"]);
        assert_eq!(listed(text, "VM_GLOBAL_FAST").collect::<Vec<_>>(), ["verilated", "verilated_threads"]);
        assert_eq!(listed(text, "VM_GLOBAL_SLOW").next(), None);
    }

    #[test]
    fn a_damaged_program_is_made_again() {
        let folder = std::env::temp_dir().join(format!("takt-verilator-{}", std::process::id()));
        let (path, count) = (folder.join("top-1"), Cell::new(0));
        let build = || {
            once(&path, |work: &Path| {
                count.set(count.get() + 1);
                fs::write(work.join("made"), "native code").map_err(super::file_error(work))
            })
            .unwrap()
        };
        let program = build();
        assert_eq!((build(), count.get()), (program.clone(), 1));
        for damaged in ["native codE", "native", ""] {
            fs::write(&program, damaged).unwrap();
            assert_eq!(
                (build(), fs::read_to_string(&program).unwrap().as_str()),
                (program.clone(), "native code")
            );
        }
        assert_eq!(count.get(), 4);
        // A file in place of the folder, as earlier versions stored programs.
        fs::remove_dir_all(&path).unwrap();
        fs::write(&path, "old").unwrap();
        assert_eq!((build(), count.get()), (program, 5));
        fs::remove_dir_all(&folder).unwrap();
    }
}
