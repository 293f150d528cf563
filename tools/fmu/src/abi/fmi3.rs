// SPDX-License-Identifier: MIT OR Apache-2.0
//! FMI 3.0 for co-simulation.
#![expect(unsafe_code, reason = "an exported name, which the standard states, is an unsafe attribute")]

use super::raw::{Component, Environment, In, Log, Logger3, Out, State, Text};
use super::{Status, call, instantiate};
use crate::description::ERROR;
use crate::instance::Mistake;
use crate::variables::TIME;
use std::ffi::{c_char, c_void};
use std::path::Path;
use takt_isa::Type;

/// Boolean of FMI 3.0: one byte, 0 or another number.
type Boolean = u8;

#[unsafe(no_mangle)]
extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi3SetDebugLogging(component: Component, on: Boolean, _: usize, _: In<Text>) -> Status {
    call(&component, |handle| {
        handle.is_logging = on != 0;
        Ok(())
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi3InstantiateCoSimulation(
    _name: Text,
    token: Text,
    resources: Text,
    _visible: Boolean,
    on: Boolean,
    _event_mode: Boolean,
    _early_return: Boolean,
    _intermediate: In<u32>,
    _intermediate_count: usize,
    environment: Environment,
    logger: Option<Logger3>,
    _update: *const c_void,
) -> Component {
    let resources = resources.read();
    instantiate(Log::three(logger, &environment), on != 0, &token.read(), Ok(Path::new(&resources)))
}

/// An instance of another kind: none.
fn other_kind(environment: &Environment, logger: Option<Logger3>) -> Component {
    Log::three(logger, environment).write(Status::Error, ERROR, "this FMU is for co-simulation only");
    Component::null()
}

#[unsafe(no_mangle)]
extern "C" fn fmi3InstantiateModelExchange(
    _name: Text,
    _token: Text,
    _resources: Text,
    _visible: Boolean,
    _on: Boolean,
    environment: Environment,
    logger: Option<Logger3>,
) -> Component {
    other_kind(&environment, logger)
}

#[unsafe(no_mangle)]
extern "C" fn fmi3InstantiateScheduledExecution(
    _name: Text,
    _token: Text,
    _resources: Text,
    _visible: Boolean,
    _on: Boolean,
    environment: Environment,
    logger: Option<Logger3>,
    _update: *const c_void,
    _lock: *const c_void,
    _unlock: *const c_void,
) -> Component {
    other_kind(&environment, logger)
}

#[unsafe(no_mangle)]
extern "C" fn fmi3FreeInstance(component: Component) {
    component.free();
}

#[unsafe(no_mangle)]
extern "C" fn fmi3EnterInitializationMode(
    component: Component,
    _has_tolerance: Boolean,
    _tolerance: f64,
    start: f64,
    _has_stop: Boolean,
    _stop: f64,
) -> Status {
    call(&component, |handle| handle.instance.enter_initialisation(start))
}

#[unsafe(no_mangle)]
extern "C" fn fmi3ExitInitializationMode(component: Component) -> Status {
    call(&component, |handle| handle.instance.exit_initialisation())
}

#[unsafe(no_mangle)]
extern "C" fn fmi3Terminate(component: Component) -> Status {
    call(&component, |handle| handle.instance.terminate())
}

#[unsafe(no_mangle)]
extern "C" fn fmi3Reset(component: Component) -> Status {
    call(&component, |handle| {
        handle.instance.reset();
        Ok(())
    })
}

/// Checks that each variable has one value: none is an array.
fn same(count: usize, values: usize) -> Result<(), Mistake> {
    match count == values {
        true => Ok(()),
        false => Err(Mistake::Call(format!("{values} values for {count} variables"))),
    }
}

/// The functions that get and set variables of one type.
macro_rules! variables {
    ($get:ident, $set:ident, $rust:ty, $type:expr, $from:expr, $to:expr) => {
        #[unsafe(no_mangle)]
        extern "C" fn $get(
            component: Component,
            references: In<u32>,
            count: usize,
            values: Out<$rust>,
            value_count: usize,
        ) -> Status {
            call(&component, |handle| {
                same(count, value_count)?;
                let references = references.read(count)?;
                values.write(count, |index| Ok($from(handle.instance.get(references[index], &[$type])?)))
            })
        }

        #[unsafe(no_mangle)]
        extern "C" fn $set(
            component: Component,
            references: In<u32>,
            count: usize,
            values: In<$rust>,
            value_count: usize,
        ) -> Status {
            call(&component, |handle| {
                same(count, value_count)?;
                let mut pairs = references.read(count)?.iter().zip(values.read(count)?);
                pairs
                    .try_for_each(|(&reference, &value)| handle.instance.set(reference, &[$type], $to(value)))
            })
        }
    };
}

variables!(fmi3GetFloat32, fmi3SetFloat32, f32, Type::F, f32::from_bits, f32::to_bits);
variables!(fmi3GetInt32, fmi3SetInt32, i32, Type::I, u32::cast_signed, i32::cast_unsigned);
variables!(fmi3GetUInt32, fmi3SetUInt32, u32, Type::B, u32::from, u32::from);

/// The time is the only variable of this type.
#[unsafe(no_mangle)]
extern "C" fn fmi3GetFloat64(
    component: Component,
    references: In<u32>,
    count: usize,
    values: Out<f64>,
    value_count: usize,
) -> Status {
    call(&component, |handle| {
        same(count, value_count)?;
        let references = references.read(count)?;
        values.write(count, |index| match references[index] {
            TIME => Ok(handle.instance.time()),
            reference => Err(Mistake::Reference(reference)),
        })
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi3GetBoolean(
    component: Component,
    references: In<u32>,
    count: usize,
    values: Out<Boolean>,
    value_count: usize,
) -> Status {
    call(&component, |handle| {
        same(count, value_count)?;
        let references = references.read(count)?;
        values.write(count, |index| Ok(handle.instance.boolean(references[index])?.into()))
    })
}

#[unsafe(no_mangle)]
extern "C" fn fmi3SetBoolean(
    component: Component,
    references: In<u32>,
    count: usize,
    values: In<Boolean>,
    value_count: usize,
) -> Status {
    call(&component, |handle| {
        same(count, value_count)?;
        let mut pairs = references.read(count)?.iter().zip(values.read(count)?);
        pairs.try_for_each(|(&reference, &value)| handle.instance.set_boolean(reference, value != 0))
    })
}

no_variables!(
    fmi3SetFloat64 fmi3GetInt8 fmi3SetInt8 fmi3GetUInt8 fmi3SetUInt8 fmi3GetInt16 fmi3SetInt16 fmi3GetUInt16 fmi3SetUInt16 fmi3GetInt64
    fmi3SetInt64 fmi3GetUInt64 fmi3SetUInt64 fmi3GetString fmi3SetString fmi3GetBinary fmi3SetBinary
    fmi3GetClock fmi3SetClock
);

states!(
    fmi3GetFMUState fmi3SetFMUState fmi3FreeFMUState fmi3SerializedFMUStateSize
    fmi3SerializeFMUState fmi3DeserializeFMUState
);

#[unsafe(no_mangle)]
extern "C" fn fmi3DoStep(
    component: Component,
    time: f64,
    size: f64,
    _no_return: Boolean,
    event: Out<Boolean>,
    terminate: Out<Boolean>,
    early_return: Out<Boolean>,
    last: Out<f64>,
) -> Status {
    let status = call(&component, |handle| {
        let result = handle.step(time, size);
        last.set(handle.instance.time());
        result
    });
    [event, terminate, early_return].iter().for_each(|flag| flag.set(0));
    status
}

refused!(
    fmi3EnterEventMode fmi3EnterStepMode fmi3EvaluateDiscreteStates fmi3UpdateDiscreteStates fmi3GetNumberOfVariableDependencies
    fmi3GetVariableDependencies fmi3GetDirectionalDerivative fmi3GetAdjointDerivative fmi3EnterConfigurationMode
    fmi3ExitConfigurationMode fmi3GetIntervalDecimal fmi3GetIntervalFraction fmi3GetShiftDecimal fmi3GetShiftFraction
    fmi3SetIntervalDecimal fmi3SetIntervalFraction fmi3SetShiftDecimal fmi3SetShiftFraction fmi3EnterContinuousTimeMode
    fmi3CompletedIntegratorStep fmi3SetTime fmi3SetContinuousStates fmi3GetContinuousStateDerivatives fmi3GetEventIndicators
    fmi3GetContinuousStates fmi3GetNominalsOfContinuousStates fmi3GetNumberOfEventIndicators fmi3GetNumberOfContinuousStates
    fmi3GetOutputDerivatives fmi3ActivateModelPartition
);
