// SPDX-License-Identifier: MIT OR Apache-2.0
//! FMI 2.0 for co-simulation.
#![expect(unsafe_code, reason = "an exported name, which the standard states, is an unsafe attribute")]

use super::raw::{Callbacks, Component, In, Log, Out, State, Text};
use super::{Status, call, instantiate};
use std::ffi::{c_char, c_int};
use std::path::{Path, PathBuf};
use takt_isa::Type;

/// Types that are `Integer` in FMI 2.0.
const INTEGER: [Type; 2] = [Type::I, Type::B];
/// `fmi2CoSimulation`.
const CO_SIMULATION: c_int = 1;
/// `fmi2LastSuccessfulTime`.
const LAST_SUCCESSFUL_TIME: c_int = 2;
/// `fmi2Terminated`.
const TERMINATED: c_int = 3;

/// Path of the resources from their address, `file:///folder/resources`.
fn path(address: &str) -> Result<PathBuf, String> {
    let wrong = || format!("the address of the resources, `{address}`, is no file on this computer");
    // Some masters hand over a plain path.
    let Some(rest) = address.strip_prefix("file:") else {
        return if Path::new(address).is_absolute() { Ok(PathBuf::from(address)) } else { Err(wrong()) };
    };
    let path = rest.strip_prefix("//localhost").or_else(|| rest.strip_prefix("//")).unwrap_or(rest);
    let mut bytes = Vec::new();
    let mut encoded = path.bytes();
    while let Some(byte) = encoded.next() {
        if byte != b'%' {
            bytes.push(byte);
            continue;
        }
        let digit = |byte: Option<u8>| byte.and_then(|byte| char::from(byte).to_digit(16));
        let (Some(high), Some(low)) = (digit(encoded.next()), digit(encoded.next())) else {
            return Err(wrong());
        };
        bytes.push((16 * high + low) as u8);
    }
    match String::from_utf8(bytes) {
        Ok(path) if path.starts_with('/') => Ok(PathBuf::from(without_root(&path))),
        _ => Err(wrong()),
    }
}

/// Path of Windows, `C:/folder`, for `/C:/folder`, as an address has it; any other path as it is.
fn without_root(path: &str) -> &str {
    match path.as_bytes() {
        [b'/', letter, b':', ..] if cfg!(windows) && letter.is_ascii_alphabetic() => &path[1..],
        _ => path,
    }
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetDebugLogging(component: Component, on: c_int, _: usize, _: In<Text>) -> Status {
    call(&component, |handle| {
        handle.is_logging = on != 0;
        Ok(())
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi2Instantiate(
    name: Text,
    kind: c_int,
    guid: Text,
    resources: Text,
    callbacks: In<Callbacks>,
    _visible: c_int,
    on: c_int,
) -> Component {
    let log = Log::two(&callbacks, &name.read());
    let resources = match kind {
        CO_SIMULATION => path(&resources.read()),
        _ => Err("this FMU is for co-simulation only".to_owned()),
    };
    instantiate(log, on != 0, &guid.read(), resources.as_deref().map_err(Clone::clone).map(Path::new))
}

#[unsafe(no_mangle)]
extern "C" fn fmi2FreeInstance(component: Component) {
    component.free();
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetupExperiment(
    component: Component,
    _has_tolerance: c_int,
    _tolerance: f64,
    start: f64,
    _has_stop: c_int,
    _stop: f64,
) -> Status {
    call(&component, |handle| {
        handle.start = start;
        Ok(())
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi2EnterInitializationMode(component: Component) -> Status {
    call(&component, |handle| handle.instance.enter_initialisation(handle.start))
}

#[unsafe(no_mangle)]
extern "C" fn fmi2ExitInitializationMode(component: Component) -> Status {
    call(&component, |handle| handle.instance.exit_initialisation())
}

#[unsafe(no_mangle)]
extern "C" fn fmi2Terminate(component: Component) -> Status {
    call(&component, |handle| handle.instance.terminate())
}

#[unsafe(no_mangle)]
extern "C" fn fmi2Reset(component: Component) -> Status {
    call(&component, |handle| {
        handle.start = 0.0;
        handle.instance.reset();
        Ok(())
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetReal(
    component: Component,
    references: In<u32>,
    count: usize,
    values: Out<f64>,
) -> Status {
    call(&component, |handle| {
        let references = references.read(count)?;
        values.write(count, |index| handle.instance.real(references[index]))
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetInteger(
    component: Component,
    references: In<u32>,
    count: usize,
    values: Out<i32>,
) -> Status {
    call(&component, |handle| {
        let references = references.read(count)?;
        values.write(count, |index| Ok(handle.instance.get(references[index], &INTEGER)?.cast_signed()))
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetReal(
    component: Component,
    references: In<u32>,
    count: usize,
    values: In<f64>,
) -> Status {
    call(&component, |handle| {
        let mut pairs = references.read(count)?.iter().zip(values.read(count)?);
        pairs.try_for_each(|(&reference, &value)| handle.instance.set_real(reference, value))
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetInteger(
    component: Component,
    references: In<u32>,
    count: usize,
    values: In<i32>,
) -> Status {
    call(&component, |handle| {
        let mut pairs = references.read(count)?.iter().zip(values.read(count)?);
        pairs.try_for_each(|(&reference, &value)| {
            handle.instance.set(reference, &INTEGER, value.cast_unsigned())
        })
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetBoolean(
    component: Component,
    references: In<u32>,
    count: usize,
    values: Out<c_int>,
) -> Status {
    call(&component, |handle| {
        let references = references.read(count)?;
        values.write(count, |index| Ok(handle.instance.boolean(references[index])?.into()))
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetBoolean(
    component: Component,
    references: In<u32>,
    count: usize,
    values: In<c_int>,
) -> Status {
    call(&component, |handle| {
        let mut pairs = references.read(count)?.iter().zip(values.read(count)?);
        pairs.try_for_each(|(&reference, &value)| handle.instance.set_boolean(reference, value != 0))
    })
}

states!(
    fmi2GetFMUstate fmi2SetFMUstate fmi2FreeFMUstate fmi2SerializedFMUstateSize
    fmi2SerializeFMUstate fmi2DeSerializeFMUstate
);

#[unsafe(no_mangle)]
extern "C" fn fmi2DoStep(component: Component, time: f64, size: f64, _no_return: c_int) -> Status {
    call(&component, |handle| handle.step(time, size))
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetRealStatus(component: Component, kind: c_int, value: Out<f64>) -> Status {
    if kind != LAST_SUCCESSFUL_TIME {
        return Status::Discard;
    }
    call(&component, |handle| value.write(1, |_| Ok(handle.instance.time())))
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetBooleanStatus(component: Component, kind: c_int, value: Out<c_int>) -> Status {
    if kind != TERMINATED {
        return Status::Discard;
    }
    // The program itself does not end the simulation.
    call(&component, |_| value.write(1, |_| Ok(0)))
}

/// No step is ever pending, so no other status has a value.
macro_rules! no_status {
    ($($name:ident)*) => {
        $(
        #[unsafe(no_mangle)]
        extern "C" fn $name(_component: Component) -> Status {
            Status::Discard
        }
        )*
    };
}

no_status!(fmi2GetStatus fmi2GetIntegerStatus fmi2GetStringStatus);

no_variables!(fmi2GetString fmi2SetString);

refused!(fmi2GetDirectionalDerivative fmi2SetRealInputDerivatives fmi2GetRealOutputDerivatives fmi2CancelStep);

#[cfg(test)]
mod tests {
    use super::path;
    use std::path::Path;

    #[test]
    fn addresses_become_paths() {
        for (address, expected) in [
            ("file:///tmp/a/resources", "/tmp/a/resources"),
            ("file:/tmp/a%20b/r", "/tmp/a b/r"),
            ("file://localhost/tmp/gr%C3%B6%C3%9Fe", "/tmp/größe"),
            ("/tmp/100%25", "/tmp/100%25"),
        ] {
            assert_eq!(path(address).as_deref(), Ok(Path::new(expected)));
        }
        for address in
            ["", "http://host/r", "file:///a%2", "file:///a%zz", "file:///%ff", "file://host/r", "resources"]
        {
            assert!(path(address).is_err(), "{address}");
        }
    }
}
