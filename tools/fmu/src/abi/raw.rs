// SPDX-License-Identifier: MIT OR Apache-2.0
//! The master's memory: arguments of the exported functions, each a pointer with what the standards promise about it. The only module that
//! follows pointers; every argument may be null.
#![expect(unsafe_code, reason = "a master in C hands over pointers, which no safe code can follow")]

use super::{Handle, Status};
use crate::instance::Mistake;
use crate::state::SavedState;
use std::any::Any;
use std::ffi::{CStr, CString, c_char, c_int, c_void};

fn null() -> Mistake {
    Mistake::Call("a null pointer in place of an argument".to_owned())
}

/// Array that the master lends for a call, to read.
#[repr(transparent)]
pub(super) struct In<T>(*const T);

impl<T: Copy> In<T> {
    /// The elements.
    #[inline]
    pub(super) fn read(&self, count: usize) -> Result<&[T], Mistake> {
        match (count, self.0.is_null()) {
            (0, _) => Ok(&[]),
            (_, true) => Err(null()),
            // SAFETY: the standards oblige the master to pass `count` initialised elements that nobody changes during the call.
            (_, false) => Ok(unsafe { std::slice::from_raw_parts(self.0, count) }),
        }
    }
}

/// Array that the master lends for a call, to write.
#[repr(transparent)]
pub(super) struct Out<T>(*mut T);

impl<T: Copy> Out<T> {
    /// Sets the elements to values, one each.
    #[inline]
    pub(super) fn write(
        &self,
        count: usize,
        mut value: impl FnMut(usize) -> Result<T, Mistake>,
    ) -> Result<(), Mistake> {
        if count > 0 && self.0.is_null() {
            return Err(null());
        }
        for index in 0..count {
            let value = value(index)?;
            // SAFETY: the standards oblige the master to pass room for `count` elements, which nobody else uses during the call.
            unsafe { self.0.add(index).write(value) };
        }
        Ok(())
    }

    /// Sets the only element, unless the pointer is null.
    #[inline]
    pub(super) fn set(&self, value: T) {
        // Null is the only possible mistake, and here it is none.
        let _ = self.write(1, |_| Ok(value));
    }
}

/// Text that the master lends for a call.
#[repr(transparent)]
pub(super) struct Text(*const c_char);

impl Text {
    /// The text; empty if the pointer is null.
    pub(super) fn read(&self) -> String {
        if self.0.is_null() {
            return String::new();
        }
        // SAFETY: the standards oblige the master to end texts with a zero byte, and to leave them alone during the call.
        unsafe { CStr::from_ptr(self.0) }.to_string_lossy().into_owned()
    }
}

/// Instance, as a pointer that the master keeps.
#[repr(transparent)]
pub(super) struct Component(*mut Handle);

impl Component {
    pub(super) fn null() -> Component {
        Component(std::ptr::null_mut())
    }

    /// Hands an instance over to the master.
    pub(super) fn of(handle: Handle) -> Component {
        Component(Box::into_raw(Box::new(handle)))
    }

    /// The instance; `None` for null.
    #[expect(
        clippy::mut_from_ref,
        reason = "the argument is the pointer; what it points to belongs to the call alone"
    )]
    #[inline]
    pub(super) fn handle(&self) -> Option<&mut Handle> {
        // SAFETY: a component that is not null comes from `of`, and the standards forbid its use after `free`, and two calls at once.
        unsafe { self.0.as_mut() }
    }

    /// Ends the instance.
    pub(super) fn free(self) {
        if !self.0.is_null() {
            // SAFETY: as in `handle`; the master does not use the component again.
            drop(unsafe { Box::from_raw(self.0) });
        }
    }
}

/// Saved state, as a pointer that the master keeps.
#[repr(transparent)]
#[derive(Clone, Copy)]
pub(super) struct State(*mut SavedState);

impl State {
    /// The state.
    pub(super) fn read(&self) -> Result<&SavedState, Mistake> {
        // SAFETY: a state that is not null comes from `Out::hand_over`, and the standards forbid its use after it was freed.
        unsafe { self.0.as_ref() }.ok_or_else(null)
    }
}

impl Out<State> {
    /// Hands a state over to the master: in place of one that the master returns, or as a new one.
    pub(super) fn hand_over(&self, saved: SavedState) -> Result<(), Mistake> {
        // SAFETY: the standards oblige the master to pass null, or a pointer to a state, which is null or from here.
        let Some(place) = (unsafe { self.0.as_mut() }) else { return Err(null()) };
        // SAFETY: as of `State::read`; nobody else uses the state during the call.
        match unsafe { place.0.as_mut() } {
            Some(old) => *old = saved,
            None => place.0 = Box::into_raw(Box::new(saved)),
        }
        Ok(())
    }

    /// Ends a state, and sets the master's pointer to null.
    pub(super) fn free(&self) {
        // SAFETY: as in `hand_over`.
        let Some(place) = (unsafe { self.0.as_mut() }) else { return };
        if !place.0.is_null() {
            // SAFETY: as of `State::read`; the master's pointer is null from here on.
            drop(unsafe { Box::from_raw(place.0) });
            place.0 = std::ptr::null_mut();
        }
    }
}

/// Logger of FMI 2.0: environment, name of the instance, status, category, message in the manner of `printf`.
type Logger2 = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);
/// Logger of FMI 3.0: environment, status, category, message.
pub(super) type Logger3 = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);

/// Environment of the master, which only the master uses.
#[repr(transparent)]
pub(super) struct Environment(*mut c_void);

/// `fmi2CallbackFunctions`.
#[repr(C)]
#[derive(Clone, Copy)]
pub(super) struct Callbacks {
    logger: Option<Logger2>,
    allocate: *const c_void,
    free: *const c_void,
    step_finished: *const c_void,
    environment: *mut c_void,
}

/// The master's log.
pub(super) enum Log {
    Two { logger: Option<Logger2>, environment: *mut c_void, name: CString },
    Three { logger: Option<Logger3>, environment: *mut c_void },
}

impl Log {
    /// Log of FMI 2.0.
    pub(super) fn two(callbacks: &In<Callbacks>, name: &str) -> Log {
        let (logger, environment) = match callbacks.read(1) {
            Ok([callbacks]) => (callbacks.logger, callbacks.environment),
            _ => (None, std::ptr::null_mut()),
        };
        Log::Two { logger, environment, name: c_text(name) }
    }

    /// Log of FMI 3.0.
    pub(super) fn three(logger: Option<Logger3>, environment: &Environment) -> Log {
        Log::Three { logger, environment: environment.0 }
    }

    /// Writes a message.
    pub(super) fn write(&self, status: Status, category: &str, message: &str) {
        let category = c_text(category);
        match self {
            Log::Two { logger: Some(logger), environment, name } => {
                // The message is a format of `printf`.
                let message = c_text(&message.replace('%', "%%"));
                // SAFETY: the master's function, with texts that live for the call and no value for the format.
                unsafe {
                    logger(*environment, name.as_ptr(), status as c_int, category.as_ptr(), message.as_ptr());
                }
            }
            Log::Three { logger: Some(logger), environment } => {
                let message = c_text(message);
                // SAFETY: the master's function, with texts that live for the call.
                unsafe { logger(*environment, status as c_int, category.as_ptr(), message.as_ptr()) }
            }
            Log::Two { .. } | Log::Three { .. } => {}
        }
    }
}

/// Text for C, without its zero bytes.
fn c_text(text: &str) -> CString {
    CString::new(text.replace('\0', "")).unwrap_or_default()
}

/// Message of a panic.
pub(super) fn panic_text(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied().map(str::to_owned);
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_default();
    format!("a mistake in Takt: {text}")
}
