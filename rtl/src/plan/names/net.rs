//! Nets of the core that are no slot's.

use crate::verilog::Net;

macro_rules! nets {
    ($($(#[$text:meta])* $name:ident $net:literal $($width:literal)?;)*) => {
        $($(#[$text])* pub const $name: Net = nets!(@ $net $($width)?);)*
    };
    (@ $net:literal) => { Net::bit($net) };
    (@ $net:literal $width:literal) => { Net::bus($net, $width) };
}

/// Parameter: how many input ports are latched.
pub static LATCHED: Net = Net::bit("LATCHED");

/// Parameter: cycles from an output port's number to its value.
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
    /// An output port, by number, as the outside is to see it.
    READ_VALUE "read_value" 32;
    /// A `wait` issued two cycles ago.
    ENDED "ended";
    /// The tick.
    TICK "tick";
    /// The program waits for it.
    WAITING "waiting";
    /// It came too early, since reset.
    DEADLINE_MISSED "deadline_missed";
    /// It is seen too early in this cycle.
    TICK_MISSED "tick_missed";
    /// It is lost in this cycle.
    TICK_LOST "tick_lost";
    /// The program has ended.
    HALTED "halted";
    /// A bundle was at fault.
    FAULT "fault";
    /// In what way.
    FAULT_KIND "fault_kind" 3;
    /// In which slot.
    FAULT_SLOT "fault_slot" 3;
    /// At which address.
    FAULT_ADDRESS "fault_address" 16;
    /// A bundle issued two cycles ago.
    ISSUED "issued";
    /// Its address.
    ISSUED_ADDRESS "issued_address" 16;
    /// A word was stored.
    STORED "stored";
    /// Where.
    STORED_ADDRESS "stored_address" 16;
    /// What.
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
    /// To which of the port's two places it goes.
    INPUT1_PLACE "input1_place";
    /// Bundles read it from now on.
    INPUT1_NOW "input1_now";
    /// Values that were written to input ports are read from now on, latched or not.
    INPUTS_OPEN "inputs_open";
    /// Values that were written to latched input ports are read from now on.
    INPUTS_TAKEN "inputs_taken";
    /// The tick, seen.
    TICKS "ticks";

    // ---- control
    /// All stages move on.
    ADVANCE "advance";
    /// The bundle in issue issues.
    ISSUE "issue";
    /// The bundles that were fetched do not count.
    FLUSH "flush";
    /// Nothing issues in the next cycle.
    BLOCK "block";
    /// An illegal bundle would be next.
    REFUSED "refused";
    /// There is a bundle in match.
    M_VALID "m_valid";
    /// The fetch has left the program memory.
    F_OUTSIDE "f_outside";
    /// Likewise the word in decode.
    D_OUTSIDE "d_outside";
    /// The bundle in issue: its address.
    I_ADDRESS "i_address" 16;
    /// A result will be on its way in the next cycle.
    PENDING "pending";
    /// The bundle in read waits for the drain.
    R_DRAIN "r_drain";
    /// The bundle in issue waits for the drain.
    I_DRAIN "i_drain";
    /// The bundle in read may issue in the next cycle.
    R_READY "r_ready";
    /// The bundle in issue may issue in the next cycle.
    I_READY "i_ready";
    /// The bundle in read cannot issue.
    R_ILLEGAL "r_illegal";

    // ---- execute
    /// A bundle issued in the last cycle.
    X_ISSUED "x_issued";
    /// Its address.
    X_ADDRESS "x_address" 16;
    /// Its address lies outside the data memory.
    X_ADDRESS_FAULT "x_address_fault";
    /// A bundle issued two cycles ago.
    WAS_ISSUED "was_issued";
    /// Its address.
    WAS_ADDRESS "was_address" 16;
    /// A load is executed.
    X_LOAD "x_load";
    /// A store is executed.
    X_STORE "x_store";
    /// Its offset.
    X_OFFSET "x_offset" 12;
    /// A load's result is there.
    LOAD_VALID "load_valid";
    /// A load's result.
    LOAD_RESULT "load_result" 32;

    // ---- status
    /// The sticky flags until the last cycle.
    STICKY "sticky" 3;
    /// The sticky flags in this cycle.
    STICKY_NOW "sticky_now" 3;
    /// Flags that are raised in this cycle.
    NEW_FLAGS "new_flags" 3;
    /// The sticky flags are cleared.
    X_CLEAR_FLAGS "x_clear_flags";
}
