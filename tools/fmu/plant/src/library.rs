// SPDX-License-Identifier: MIT OR Apache-2.0
//! The functions of an FMU's library, as the standards' C headers declare them. The only module that calls foreign code; it runs in a process
//! of its own, because no check here keeps a library from breaking that process.
#![expect(unsafe_code, reason = "an FMU is a library in C, which no safe code can load or call")]

use crate::description::{Description, Kind, Variable, Version};
use libloading::{Library, Symbol};
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::path::Path;
use std::ptr;
use std::sync::Mutex;

/// Last message of the FMU's log.
static LOG: Mutex<String> = Mutex::new(String::new());
/// Characters of a message that are kept.
const LOGGED: usize = 1000;

fn logged(text: *const c_char) {
    if text.is_null() {
        return;
    }
    // SAFETY: the standards oblige the FMU to end texts with a zero byte, and to leave them alone during the call.
    let text = unsafe { CStr::from_ptr(text) }.to_string_lossy();
    if let Ok(mut log) = LOG.lock() {
        *log = text.chars().take(LOGGED).collect();
    }
}

/// Logger of FMI 2.0. The standard declares it with a variable number of arguments, which Rust cannot define; on all platforms of
/// `archive.rs` the fixed arguments of such a call lie where these are. So the message comes with its `%`.
extern "C" fn log_2(_: *mut c_void, _: *const c_char, _: c_int, _: *const c_char, message: *const c_char) {
    logged(message);
}

extern "C" fn log_3(_: *mut c_void, _: c_int, _: *const c_char, message: *const c_char) {
    logged(message);
}

// SAFETY: C's own functions, declared as C does.
unsafe extern "C" {
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(memory: *mut c_void);
}

/// `fmi2CallbackFunctions`.
#[repr(C)]
struct Callbacks {
    logger: extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char),
    allocate: unsafe extern "C" fn(usize, usize) -> *mut c_void,
    free: unsafe extern "C" fn(*mut c_void),
    step_finished: *const c_void,
    environment: *mut c_void,
}

// SAFETY: the structure is constant, and its null pointers point nowhere.
unsafe impl Sync for Callbacks {}

static CALLBACKS: Callbacks = Callbacks {
    logger: log_2,
    allocate: calloc,
    free,
    step_finished: ptr::null(),
    environment: ptr::null_mut(),
};

type Instance = *mut c_void;
type Call = unsafe extern "C" fn(Instance) -> c_int;
type Set2<T> = unsafe extern "C" fn(Instance, *const u32, usize, *const T) -> c_int;
type Get2<T> = unsafe extern "C" fn(Instance, *const u32, usize, *mut T) -> c_int;
type Set3<T> = unsafe extern "C" fn(Instance, *const u32, usize, *const T, usize) -> c_int;
type Get3<T> = unsafe extern "C" fn(Instance, *const u32, usize, *mut T, usize) -> c_int;
type Instantiate2 = unsafe extern "C" fn(
    *const c_char,
    c_int,
    *const c_char,
    *const c_char,
    *const Callbacks,
    c_int,
    c_int,
) -> Instance;
type Setup2 = unsafe extern "C" fn(Instance, c_int, f64, f64, c_int, f64) -> c_int;
type Step2 = unsafe extern "C" fn(Instance, f64, f64, c_int) -> c_int;
type Instantiate3 = unsafe extern "C" fn(
    *const c_char,
    *const c_char,
    *const c_char,
    bool,
    bool,
    bool,
    bool,
    *const u32,
    usize,
    *mut c_void,
    extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char),
    *const c_void,
) -> Instance;
type Enter3 = unsafe extern "C" fn(Instance, bool, f64, f64, bool, f64) -> c_int;
type Step3 =
    unsafe extern "C" fn(Instance, f64, f64, bool, *mut bool, *mut bool, *mut bool, *mut f64) -> c_int;

/// Loaded library with an instance of its FMU.
pub(crate) struct LoadedFmu {
    library: Library,
    version: Version,
    instance: Instance,
}

/// Result of a call by its status: 0 is right, 1 right with a warning.
fn check(function: &str, status: c_int) -> Result<(), String> {
    let name = match status {
        0 | 1 => return Ok(()),
        2 => "discarded the step",
        3 => "failed",
        4 => "failed for good",
        _ => "failed with an unknown status",
    };
    let log = LOG.lock().map(|mut log| std::mem::take(&mut *log)).unwrap_or_default();
    let said = if log.is_empty() { String::new() } else { format!(": {}", log.trim()) };
    Err(format!("{function} {name}{said}"))
}

fn text(text: &str) -> CString {
    CString::new(text.replace('\0', "")).unwrap_or_default()
}

impl LoadedFmu {
    /// Loads the library of an FMU that is unpacked in `folder`, an absolute path, and makes an instance.
    pub(crate) fn new(description: &Description, library: &Path, folder: &Path) -> Result<LoadedFmu, String> {
        // SAFETY: the library's initialisation is foreign code, which may do anything to this process: that is what the process is for.
        let library = unsafe { Library::new(library) };
        let library = library.map_err(|error| {
            let error = error.to_string();
            let needs_python = error.contains("undefined symbol: _Py") || error.contains("undefined symbol: Py");
            let mend = if needs_python {
                "; it expects a process with Python inside: `LD_PRELOAD=…/libpython3.….so takt run …` gives it one"
            } else {
                ""
            };
            format!("its library cannot be loaded: {error}{mend}")
        })?;
        let version = description.version;
        let mut loaded = LoadedFmu { library, version, instance: ptr::null_mut() };
        let (name, token) = (text("plant"), text(&description.token));
        let resources = folder.join("resources");
        let instance = match version {
            Version::Two => {
                let uri = text(&format!("file://{}", percent_encoded(&resources.to_string_lossy())));
                let instantiate: Symbol<'_, Instantiate2> = loaded.function("fmi2Instantiate")?;
                // SAFETY: arguments of the declared types, which live for the call; the callbacks live for ever. 1 is co-simulation.
                unsafe {
                    instantiate(name.as_ptr(), 1, token.as_ptr(), uri.as_ptr(), &raw const CALLBACKS, 0, 0)
                }
            }
            Version::Three => {
                let path = text(&format!("{}/", resources.to_string_lossy()));
                let instantiate: Symbol<'_, Instantiate3> = loaded.function("fmi3InstantiateCoSimulation")?;
                // SAFETY: as above; no event mode, no early return, no variables in between steps.
                unsafe {
                    instantiate(
                        name.as_ptr(),
                        token.as_ptr(),
                        path.as_ptr(),
                        false,
                        false,
                        false,
                        false,
                        ptr::null(),
                        0,
                        ptr::null_mut(),
                        log_3,
                        ptr::null(),
                    )
                }
            }
        };
        if instance.is_null() {
            check("its instantiation", 3)?;
        }
        loaded.instance = instance;
        Ok(loaded)
    }

    /// Function of the library. The caller states the type that the standard declares.
    fn function<T>(&self, name: &str) -> Result<Symbol<'_, T>, String> {
        // SAFETY: the standards fix the type of each name; callers state that one. The symbol does not outlive the library.
        let symbol = unsafe { self.library.get(name.as_bytes()) };
        symbol.map_err(|_| format!("its library has no function {name}"))
    }

    fn call(&self, name: &str) -> Result<(), String> {
        let function: Symbol<'_, Call> = self.function(name)?;
        // SAFETY: the instance is the library's own, and lives until `drop`.
        check(name, unsafe { function(self.instance) })
    }

    /// Begins the initialisation, at time 0.
    pub(crate) fn enter_initialisation(&self) -> Result<(), String> {
        match self.version {
            Version::Two => {
                let setup: Symbol<'_, Setup2> = self.function("fmi2SetupExperiment")?;
                // SAFETY: as in `call`; no tolerance, no end.
                check("fmi2SetupExperiment", unsafe { setup(self.instance, 0, 0.0, 0.0, 0, 0.0) })?;
                self.call("fmi2EnterInitializationMode")
            }
            Version::Three => {
                let enter: Symbol<'_, Enter3> = self.function("fmi3EnterInitializationMode")?;
                // SAFETY: as in `call`; no tolerance, no end.
                check("fmi3EnterInitializationMode", unsafe {
                    enter(self.instance, false, 0.0, 0.0, false, 0.0)
                })
            }
        }
    }

    /// Ends the initialisation.
    pub(crate) fn exit_initialisation(&self) -> Result<(), String> {
        self.call(match self.version {
            Version::Two => "fmi2ExitInitializationMode",
            Version::Three => "fmi3ExitInitializationMode",
        })
    }

    /// Makes a step from a time, in s.
    pub(crate) fn step(&self, time: f64, size: f64) -> Result<(), String> {
        match self.version {
            Version::Two => {
                let step: Symbol<'_, Step2> = self.function("fmi2DoStep")?;
                // SAFETY: as in `call`.
                check("fmi2DoStep", unsafe { step(self.instance, time, size, 1) })
            }
            Version::Three => {
                let step: Symbol<'_, Step3> = self.function("fmi3DoStep")?;
                let (mut event, mut end, mut early, mut last) = (false, false, false, time);
                // SAFETY: as in `call`; the results live for the call.
                let status = unsafe {
                    step(self.instance, time, size, true, &mut event, &mut end, &mut early, &mut last)
                };
                check("fmi3DoStep", status)?;
                if end { Err("fmi3DoStep asked for the end of the simulation".to_owned()) } else { Ok(()) }
            }
        }
    }

    fn set_as<T>(&self, name: &str, reference: u32, value: T) -> Result<(), String> {
        let status = match self.version {
            Version::Two => {
                let set: Symbol<'_, Set2<T>> = self.function(name)?;
                // SAFETY: one reference and one value, as stated; as in `call`.
                unsafe { set(self.instance, &raw const reference, 1, &raw const value) }
            }
            Version::Three => {
                let set: Symbol<'_, Set3<T>> = self.function(name)?;
                // SAFETY: as above.
                unsafe { set(self.instance, &raw const reference, 1, &raw const value, 1) }
            }
        };
        check(name, status)
    }

    fn get_as<T: Default>(&self, name: &str, reference: u32) -> Result<T, String> {
        let mut value = T::default();
        let status = match self.version {
            Version::Two => {
                let get: Symbol<'_, Get2<T>> = self.function(name)?;
                // SAFETY: one reference, and room for one value, as stated; as in `call`.
                unsafe { get(self.instance, &raw const reference, 1, &raw mut value) }
            }
            Version::Three => {
                let get: Symbol<'_, Get3<T>> = self.function(name)?;
                // SAFETY: as above.
                unsafe { get(self.instance, &raw const reference, 1, &raw mut value, 1) }
            }
        };
        check(name, status).map(|()| value)
    }

    /// Sets a variable. An integer is the one next to the value, a truth value whether it is another one than 0.
    pub(crate) fn set(&self, variable: &Variable, value: f64) -> Result<(), String> {
        let reference = variable.reference;
        // Rust's casts saturate.
        let result = match (self.version, variable.kind) {
            (Version::Two, Kind::Float64 | Kind::Float32) => self.set_as("fmi2SetReal", reference, value),
            (Version::Two, Kind::Boolean) => {
                self.set_as("fmi2SetBoolean", reference, c_int::from(value != 0.0))
            }
            (Version::Two, _) => self.set_as("fmi2SetInteger", reference, value.round() as c_int),
            (Version::Three, Kind::Float64) => self.set_as("fmi3SetFloat64", reference, value),
            (Version::Three, Kind::Float32) => self.set_as("fmi3SetFloat32", reference, value as f32),
            (Version::Three, Kind::Int32) => self.set_as("fmi3SetInt32", reference, value.round() as i32),
            (Version::Three, Kind::UInt32) => self.set_as("fmi3SetUInt32", reference, value.round() as u32),
            (Version::Three, Kind::Int64) => self.set_as("fmi3SetInt64", reference, value.round() as i64),
            (Version::Three, Kind::Boolean) => self.set_as("fmi3SetBoolean", reference, value != 0.0),
        };
        result.map_err(|text| format!("`{}` = {value}: {text}", variable.name))
    }

    /// Value of a variable.
    pub(crate) fn get(&self, variable: &Variable) -> Result<f64, String> {
        let reference = variable.reference;
        match (self.version, variable.kind) {
            (Version::Two, Kind::Float64 | Kind::Float32) => self.get_as("fmi2GetReal", reference),
            (Version::Two, Kind::Boolean) => self.get_as::<c_int>("fmi2GetBoolean", reference).map(f64::from),
            (Version::Two, _) => self.get_as::<c_int>("fmi2GetInteger", reference).map(f64::from),
            (Version::Three, Kind::Float64) => self.get_as("fmi3GetFloat64", reference),
            (Version::Three, Kind::Float32) => self.get_as::<f32>("fmi3GetFloat32", reference).map(f64::from),
            (Version::Three, Kind::Int32) => self.get_as::<i32>("fmi3GetInt32", reference).map(f64::from),
            (Version::Three, Kind::UInt32) => self.get_as::<u32>("fmi3GetUInt32", reference).map(f64::from),
            (Version::Three, Kind::Int64) => {
                self.get_as::<i64>("fmi3GetInt64", reference).map(|value| value as f64)
            }
            // A byte, because another value than 0 and 1 is no `bool` in Rust.
            (Version::Three, Kind::Boolean) => {
                self.get_as::<u8>("fmi3GetBoolean", reference).map(|value| f64::from(u8::from(value != 0)))
            }
        }
    }
}

impl Drop for LoadedFmu {
    fn drop(&mut self) {
        if self.instance.is_null() {
            return;
        }
        let (end, release) = match self.version {
            Version::Two => ("fmi2Terminate", "fmi2FreeInstance"),
            Version::Three => ("fmi3Terminate", "fmi3FreeInstance"),
        };
        // A failure at the end changes nothing.
        let _ = self.call(end);
        if let Ok(release) = self.function::<unsafe extern "C" fn(Instance)>(release) {
            // SAFETY: the instance is not used again.
            unsafe { release(self.instance) }
        }
    }
}

/// Path in a URI.
fn percent_encoded(path: &str) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"/-._~".contains(&byte);
    let bytes = path.bytes();
    bytes
        .map(|byte| if is_plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") })
        .collect()
}
