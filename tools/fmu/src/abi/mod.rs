// SPDX-License-Identifier: MIT OR Apache-2.0
//! The functions of both standards, as C calls them. `raw` reads and writes the master's memory; `fmi2` and `fmi3` turn each call into one
//! of an [`Instance`](crate::Instance). No panic leaves a function: it ends as a fatal error.

/// Access to variables of types that no program has: none can be named.
macro_rules! no_variables {
    ($($name:ident)*) => {
        $(
        #[unsafe(no_mangle)]
        extern "C" fn $name(component: Component, references: In<u32>, count: usize) -> Status {
            crate::abi::no_variable(&component, &references, count)
        }
        )*
    };
}

/// Functions that the description does not offer. Further arguments are not read; in C's calling convention the caller removes them.
macro_rules! refused {
    ($($name:ident)*) => {
        $(
        #[unsafe(no_mangle)]
        extern "C" fn $name(component: Component) -> Status {
            crate::abi::refuse(&component, stringify!($name))
        }
        )*
    };
}

/// Functions for states, under the names of a version of the standard: get, set, free, size in bytes, to bytes, from bytes.
macro_rules! states {
    ($get:ident $set:ident $free:ident $size:ident $to_bytes:ident $from_bytes:ident) => {
        #[unsafe(no_mangle)]
        extern "C" fn $get(component: Component, state: Out<State>) -> Status {
            call(&component, |handle| state.hand_over(handle.instance.save()?))
        }

        #[unsafe(no_mangle)]
        extern "C" fn $set(component: Component, state: State) -> Status {
            call(&component, |handle| handle.instance.restore(state.read()?))
        }

        #[unsafe(no_mangle)]
        extern "C" fn $free(component: Component, state: Out<State>) -> Status {
            call(&component, |_| {
                state.free();
                Ok(())
            })
        }

        #[unsafe(no_mangle)]
        extern "C" fn $size(component: Component, state: State, size: Out<usize>) -> Status {
            crate::abi::serialised_size(&component, state, &size)
        }

        #[unsafe(no_mangle)]
        extern "C" fn $to_bytes(component: Component, state: State, bytes: Out<u8>, size: usize) -> Status {
            crate::abi::serialise(&component, state, &bytes, size)
        }

        #[unsafe(no_mangle)]
        extern "C" fn $from_bytes(
            component: Component,
            bytes: In<u8>,
            size: usize,
            state: Out<State>,
        ) -> Status {
            call(&component, |handle| state.hand_over(handle.instance.state_from_bytes(bytes.read(size)?)?))
        }
    };
}

mod fmi2;
mod fmi3;
mod raw;

use crate::description::{ERROR, WARNING};
use crate::instance::{Instance, Mistake};
use crate::model::Model;
use raw::{Component, In, Log, Out, State};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;

/// Status of a call, with the numbers of both standards.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Status {
    /// All well.
    Ok = 0,
    /// The call could do nothing; the instance is unchanged.
    Discard = 2,
    /// The call failed.
    Error = 3,
    /// The instance is lost.
    Fatal = 4,
}

/// Instance as the master holds it.
struct Handle {
    instance: Instance,
    log: Log,
    /// The master wants warnings.
    is_logging: bool,
    /// Start of the simulation, which FMI 2.0 states before the initialisation.
    start: f64,
}

/// Makes an instance for a master; null, with a message in the log, if that fails.
fn instantiate(log: Log, is_logging: bool, token: &str, resources: Result<&Path, String>) -> Component {
    let made = catch_unwind(|| {
        let model = Model::read(resources?).map_err(|error| error.to_string())?;
        if model.token() != token {
            return Err(format!(
                "the resources have the token {}, and the master's description {token}: they belong to different FMUs",
                model.token()
            ));
        }
        Instance::new(Arc::new(model)).map_err(|error| error.to_string())
    });
    let made = made.unwrap_or_else(|panic| Err(raw::panic_text(&*panic)));
    match made {
        Ok(instance) => Component::of(Handle { instance, log, is_logging, start: 0.0 }),
        Err(message) => {
            log.write(Status::Error, ERROR, &message);
            Component::null()
        }
    }
}

/// Executes a call on an instance, and logs its mistake.
#[inline]
fn call(component: &Component, action: impl FnOnce(&mut Handle) -> Result<(), Mistake>) -> Status {
    let Some(handle) = component.handle() else { return Status::Error };
    match catch_unwind(AssertUnwindSafe(|| action(&mut *handle))) {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(mistake)) => {
            handle.log.write(Status::Error, ERROR, &mistake.to_string());
            Status::Error
        }
        Err(panic) => {
            handle.log.write(Status::Fatal, ERROR, &raw::panic_text(&*panic));
            Status::Fatal
        }
    }
}

impl Handle {
    /// Runs the periods of a step, and logs its warnings if the master wants them.
    #[inline]
    fn step(&mut self, time: f64, size: f64) -> Result<(), Mistake> {
        let warnings = self.instance.step(time, size)?;
        if self.is_logging {
            // The status is that of the message; the call itself succeeds.
            warnings.iter().for_each(|text| self.log.write(Status::Ok, WARNING, text));
        }
        Ok(())
    }
}

/// A call that the FMU does not offer; its description says so.
fn refuse(component: &Component, name: &str) -> Status {
    call(component, |_| Err(Mistake::Call(format!("this FMU does not offer {name}"))))
}

/// Access to variables of a type that no program has.
fn no_variable(component: &Component, references: &In<u32>, count: usize) -> Status {
    call(component, |_| match references.read(count)?.first() {
        Some(&reference) => Err(Mistake::Reference(reference)),
        None => Ok(()),
    })
}

/// Number of bytes of a state.
fn serialised_size(component: &Component, state: State, size: &Out<usize>) -> Status {
    call(component, |handle| {
        let bytes = handle.instance.state_to_bytes(state.read()?)?;
        size.write(1, |_| Ok(bytes.len()))
    })
}

/// Bytes of a state, into the master's memory.
fn serialise(component: &Component, state: State, bytes: &Out<u8>, size: usize) -> Status {
    call(component, |handle| {
        let state = handle.instance.state_to_bytes(state.read()?)?;
        if size < state.len() {
            return Err(Mistake::Call(format!("room for {size} bytes, and the state has {}", state.len())));
        }
        bytes.write(state.len(), |index| Ok(state[index]))
    })
}
