// SPDX-License-Identifier: MIT OR Apache-2.0
//! Nets of the core that belong to no slot.

use crate::verilog::Net;

macro_rules! nets {
    ($($(#[$text:meta])* $name:ident $net:literal $($width:literal)?;)*) => {
        $($(#[$text])* pub const $name: Net = nets!(@ $net $($width)?);)*
    };
    (@ $net:literal) => { Net::bit($net) };
    (@ $net:literal $width:literal) => { Net::bus($net, $width) };
}

/// Parameter: the number of input ports that are latched.
pub static LATCHED: Net = Net::bit("LATCHED");

/// Parameter: cycles of delay from an output port's number to its value.
pub static READ_DELAY: Net = Net::bit("READ_DELAY");

nets! {
    // ---- ports
    /// The clock.
    CLK "clk";
    /// Synchronous reset.
    RST "rst";
    /// The loader writes.
    LOAD "load";
    /// The memory.
    LOAD_SPACE "load_space" 2;
    /// The slot.
    LOAD_SLOT "load_slot" 3;
    /// The word's address.
    LOAD_ADDRESS "load_address" 16;
    /// The word.
    LOAD_VALUE "load_value" 48;
    /// An input port is written.
    INPUT_WRITE "input_write";
    /// The word.
    INPUT_VALUE "input_value" 32;
    /// The visible value of the output port whose number is on the input.
    READ_VALUE "read_value" 32;
    /// A `wait` issued two cycles ago.
    ENDED "ended";
    /// The tick.
    TICK "tick";
    /// The program waits for the tick.
    WAITING "waiting";
    /// Sticky: a tick has come too early since reset.
    DEADLINE_MISSED "deadline_missed";
    /// A tick comes too early in this cycle (a missed deadline).
    TICK_MISSED "tick_missed";
    /// A tick is lost in this cycle.
    TICK_LOST "tick_lost";
    /// The program has ended.
    HALTED "halted";
    /// A bundle was at fault.
    FAULT "fault";
    /// The kind of the fault.
    FAULT_KIND "fault_kind" 3;
    /// The slot of the fault.
    FAULT_SLOT "fault_slot" 3;
    /// The address of the bundle at fault.
    FAULT_ADDRESS "fault_address" 16;
    /// A bundle issued two cycles ago.
    ISSUED "issued";
    /// Its address.
    ISSUED_ADDRESS "issued_address" 16;
    /// A word was stored.
    STORED "stored";
    /// The address of the stored word.
    STORED_ADDRESS "stored_address" 16;
    /// The stored value.
    STORED_VALUE "stored_value" 32;
    /// The sticky flags.
    STATUS "status" 3;

    // ---- loader and inputs, registered
    /// The loader writes.
    LOADS "loads";
    /// The memory.
    LOADS_SPACE "loads_space" 2;
    /// The slot.
    LOADS_SLOT "loads_slot" 3;
    /// The word's address.
    LOADS_ADDRESS "loads_address" 16;
    /// The word.
    LOADS_VALUE "loads_value" 48;
    /// The loader writes the data memory.
    LOAD_DATA "load_data";
    /// The loader writes a register.
    LOAD_REGISTER "load_register";
    /// The loader's value for a register, on the buses.
    LOADED_VALUE "loaded_value" 32;
    /// An input port is written.
    INPUT1 "input1";
    /// The word.
    INPUT1_VALUE "input1_value" 32;
    /// The same one cycle later.
    INPUT2_VALUE "input2_value" 32;
    /// Its buffer, of the two of a latched port.
    INPUT1_PLACE "input1_place";
    /// Bundles read the value from now on.
    INPUT1_NOW "input1_now";
    /// Latched input ports are open: a written value is read at once.
    INPUTS_OPEN "inputs_open";
    /// The buffers of latched input ports are swapped: the values written before are read from now on.
    INPUTS_TAKEN "inputs_taken";
    /// The tick, registered.
    TICKS "ticks";

    // ---- control
    /// All pipeline stages advance.
    ADVANCE "advance";
    /// The bundle in issue issues.
    ISSUE "issue";
    /// The bundles fetched after the redirecting one are squashed.
    FLUSH "flush";
    /// Nothing issues in the next cycle.
    BLOCK "block";
    /// The bundle in issue would be next, but is illegal.
    REFUSED "refused";
    /// The match stage holds a bundle, not a bubble.
    M_VALID "m_valid";
    /// The fetched address is outside of the program memory.
    F_OUTSIDE "f_outside";
    /// The address of the word in decode is outside of the program memory.
    D_OUTSIDE "d_outside";
    /// The address of the bundle in issue.
    I_ADDRESS "i_address" 16;
    /// A result will be in flight in the next cycle.
    PENDING "pending";
    /// The bundle in read waits for the drain.
    R_DRAIN "r_drain";
    /// The bundle in issue waits for the drain.
    I_DRAIN "i_drain";
    /// The bundle in read may issue in the next cycle.
    R_READY "r_ready";
    /// The bundle in issue may issue in the next cycle.
    I_READY "i_ready";
    /// The bundle in read is illegal.
    R_ILLEGAL "r_illegal";

    // ---- execute
    /// A bundle issued in the last cycle.
    X_ISSUED "x_issued";
    /// Its address.
    X_ADDRESS "x_address" 16;
    /// A bundle issued two cycles ago.
    WAS_ISSUED "was_issued";
    /// Its address.
    WAS_ADDRESS "was_address" 16;
    /// A store is executed.
    X_STORE "x_store";

    // ---- status
    /// The sticky flags up to the last cycle.
    STICKY "sticky" 3;
    /// The sticky flags in this cycle.
    STICKY_NOW "sticky_now" 3;
    /// Flags that are raised in this cycle.
    NEW_FLAGS "new_flags" 3;
    /// The sticky flags are cleared.
    X_CLEAR_FLAGS "x_clear_flags";
}
