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

/// Parameter: number of latched input ports.
pub static LATCHED: Net = Net::bit("LATCHED");

/// Parameter: cycles of delay from an output port's number to its value.
pub static READ_DELAY: Net = Net::bit("READ_DELAY");

/// Parameter of a pair: cycles by which the second core is later.
pub static DELAY: Net = Net::bit("DELAY");

nets! {
    // ---- ports
    /// Clock of the whole core.
    CLK "clk";
    /// Synchronous reset, active high.
    RST "rst";
    /// Words with one wrong bit that were corrected since reset, at most 255.
    CORRECTIONS "corrections" 8;
    /// Sticky: a word was wrong and could not be corrected.
    UPSET "upset";
    /// The loader writes a word.
    LOAD "load";
    /// Memory that the loader writes.
    LOAD_SPACE "load_space" 2;
    /// Slot of the loader's word, in program memory.
    LOAD_SLOT "load_slot" 3;
    /// Address of the loader's word.
    LOAD_ADDRESS "load_address" 16;
    /// Word that the loader writes.
    LOAD_VALUE "load_value" 48;
    /// An input port is written.
    INPUT_WRITE "input_write";
    /// Value written to the input port.
    INPUT_VALUE "input_value" 32;
    /// Visible value of the output port whose number is on the input.
    READ_VALUE "read_value" 32;
    /// A `wait` issued two cycles ago.
    ENDED "ended";
    /// A `publish` or a `wait` issued two cycles ago.
    PUBLISHED "published";
    /// Tick, high for one cycle.
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
    /// Kind of the fault.
    FAULT_KIND "fault_kind" 3;
    /// Slot of the fault.
    FAULT_SLOT "fault_slot" 3;
    /// Address of the bundle at fault.
    FAULT_ADDRESS "fault_address" 16;
    /// A bundle issued two cycles ago.
    ISSUED "issued";
    /// Address of the bundle that issued two cycles ago.
    ISSUED_ADDRESS "issued_address" 16;
    /// A word was stored.
    STORED "stored";
    /// Address of the stored word.
    STORED_ADDRESS "stored_address" 16;
    /// Value of the stored word.
    STORED_VALUE "stored_value" 32;
    /// Sticky flags: invalid, divide by zero, overflow.
    STATUS "status" 3;
    /// Sticky: the cores of a pair have differed since reset.
    DIFFERS "differs";

    // ---- loader and inputs, registered
    /// The loader writes a word; registered.
    LOADS "loads";
    /// Memory that the loader writes; registered.
    LOADS_SPACE "loads_space" 2;
    /// Slot of the loader's word; registered.
    LOADS_SLOT "loads_slot" 3;
    /// Address of the loader's word; registered.
    LOADS_ADDRESS "loads_address" 16;
    /// Word that the loader writes; registered.
    LOADS_VALUE "loads_value" 48;
    /// The loader writes the data memory.
    LOAD_DATA "load_data";
    /// The loader writes a register.
    LOAD_REGISTER "load_register";
    /// The loader's value for a register, on the buses.
    LOADED_VALUE "loaded_value" 32;

    // ---- error correction
    /// The scrubber reads the memories.
    SCRUBS "scrubs";
    /// The loader's registers take a repaired word.
    REPAIRS "repairs";
    /// Memory of the repaired word, as [`LOAD_SPACE`].
    REPAIR_SPACE "repair_space" 2;
    /// Slot of the repaired word.
    REPAIR_SLOT "repair_slot" 3;
    /// Address of the repaired word.
    REPAIR_ADDRESS "repair_address" 16;
    /// The repaired word.
    REPAIR_VALUE "repair_value" 48;
    /// The loader wrote a repaired word in the last cycle.
    REPAIRED "repaired";
    /// A word with one wrong bit is corrected.
    CORRECTED "corrected";
    /// A word cannot be corrected.
    WRONG "wrong";
    /// A word of the scrubber could not be repaired.
    SCRUB_FAILED "scrub_failed";
    /// Corrected word of the data memory's first port.
    DATA_CORRECTED "data_corrected" 32;
    /// The data memory writes.
    DATA_WRITES "data_writes";
    /// An input port is written; registered.
    INPUT1 "input1";
    /// Value written to the input port; registered.
    INPUT1_VALUE "input1_value" 32;
    /// Value written to the input port, one cycle after `input1_value`.
    INPUT2_VALUE "input2_value" 32;
    /// Buffer (0 or 1) of the latched port that is written.
    INPUT1_PLACE "input1_place";
    /// Bundles read the value from now on.
    INPUT1_NOW "input1_now";
    /// Latched input ports are open: a written value is read at once.
    INPUTS_OPEN "inputs_open";
    /// The buffers of latched input ports are swapped: the values written before are read from now on.
    INPUTS_TAKEN "inputs_taken";
    /// Tick, masked in reset; registered.
    TICKS "ticks";

    // ---- control
    /// All pipeline stages advance.
    ADVANCE "advance";
    /// The bundle in issue issues.
    ISSUE "issue";
    /// The bundles fetched after the redirecting one are squashed.
    FLUSH "flush";
    /// No bundle issues in the next cycle.
    BLOCK "block";
    /// The bundle in issue would be next, but is illegal.
    REFUSED "refused";
    /// The match stage holds a bundle, not a bubble.
    M_VALID "m_valid";
    /// The fetched address is outside of the program memory.
    F_OUTSIDE "f_outside";
    /// The address of the word in decode is outside of the program memory.
    D_OUTSIDE "d_outside";
    /// Address of the bundle in issue.
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
    /// Address of the bundle that issued in the last cycle.
    X_ADDRESS "x_address" 16;
    /// A bundle issued two cycles ago.
    WAS_ISSUED "was_issued";
    /// Address of the bundle that issued two cycles ago.
    WAS_ADDRESS "was_address" 16;
    /// A store is in execute.
    X_STORE "x_store";

    // ---- status
    /// Sticky flags up to the last cycle.
    STICKY "sticky" 3;
    /// Sticky flags, this cycle's included.
    STICKY_NOW "sticky_now" 3;
    /// Flags that are raised in this cycle.
    NEW_FLAGS "new_flags" 3;
    /// The sticky flags are cleared.
    X_CLEAR_FLAGS "x_clear_flags";
    /// Flags that have been cleared in the last cycle.
    CLEARED "cleared" 3;
}
