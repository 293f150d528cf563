// Runs a core in simulation for a host: the other half of `model.rs`.
//
// stdin, words of 32 bits, little-endian:
//   1 load   count, then that many (space, slot, address, low, high); space 3 is an input port. Resets, then loads
//   2 run    until, count, then that many (cycle, kind, index, value): what stands on the pins in that cycle; kind 1 tick, 2 input
//   3 trace  first, last: writes a waveform of these cycles of the run that follows the next load (built with -DTRACE)
// stdout, for each run: a count and that many events of 8 words:
//   kind, cycle, address, slot, register, value, flags, 0
// Cycle 0 is the first after reset.
//
// ports.h, which is generated, gives SLOTS, RESET_CYCLES, OUTPUTS, LATCHED and the output ports by slot.

#include "Vcore.h"
#include "verilated.h"
#ifdef TRACE
#include "verilated_vcd_c.h"
#endif
#include "ports.h"
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

// As `takt_rtl::bench::Space`.
enum Space { PROGRAM, DATA, REGISTER, INPUT };
enum Kind { ISSUE, STORE, RETIRE, PORT, MISSED, LOST, HALT, FAULT, PUBLISH };

struct Event {
    uint32_t kind, cycle, address, slot, reg, value, flags, zero;
};

static uint64_t bits(uint64_t value, unsigned low, unsigned width) {
    return value >> low & ((uint64_t(1) << width) - 1);
}

template <std::size_t N> static uint64_t bits(const VlWide<N> &value, unsigned low, unsigned width) {
    uint64_t result = 0;
    for (unsigned i = 0; i < width; i++) {
        result |= uint64_t(value.at((low + i) / 32) >> (low + i) % 32 & 1) << i;
    }
    return result;
}

static VerilatedContext context;
static Vcore *core;
static int64_t cycle;
static std::vector<Event> events;
static bool was_halted, was_fault;
// Of each output port: whether it was written since the last `wait`, and ever before that, and what it showed then.
static bool written[OUTPUTS], known[OUTPUTS];
static uint32_t shown[OUTPUTS];
static uint32_t trace_first = 1, trace_last = 0;
#ifdef TRACE
static VerilatedVcdC *waveform;
#endif

// What the memories hold, as far as it is known: what is there already is not loaded again. Of a random program that is nearly
// all, and loading both memories as a whole takes several times as long as the program.
struct Shadow {
    std::vector<uint64_t> words;
    std::vector<bool> known;

    void set(std::size_t address, uint64_t value) {
        if (address >= words.size()) {
            words.resize(address + 1);
            known.resize(address + 1);
        }
        words[address] = value;
        known[address] = true;
    }
    bool holds(std::size_t address, uint64_t value) const {
        return address < words.size() && known[address] && words[address] == value;
    }
};
static Shadow program_memory, data_memory;

static void event(uint32_t kind, int64_t at, uint32_t address, uint32_t slot, uint32_t reg, uint32_t value, uint32_t flags) {
    events.push_back({kind, uint32_t(at), address, slot, reg, value, flags, 0});
}

static void dump(int edge) {
#ifdef TRACE
    if (cycle >= int64_t(trace_first) && cycle <= int64_t(trace_last)) {
        waveform->dump(uint64_t(cycle) * 2 + edge);
    }
#else
    (void)edge;
#endif
}

static uint32_t read_output(unsigned number) {
    core->read_output = number;
    core->eval();
    return core->read_value;
}

// What the outside sees: after a `wait`, all that was written; if ports are latched, nothing else in between.
static void observe_outputs() {
    if (core->ended) {
        for (unsigned n = 0; n < OUTPUTS; n++) {
            if (!written[n] && !known[n]) continue;
            uint32_t value = read_output(n);
            if (written[n] || value != shown[n]) event(PUBLISH, cycle - 2, 0, 0, n, value, 0);
            shown[n] = value;
            known[n] = true;
            written[n] = false;
        }
    } else if (LATCHED) {
        unsigned n = cycle % OUTPUTS;
        if (known[n] && read_output(n) != shown[n]) event(PUBLISH, cycle, 0, 0, n, core->read_value, 0);
    }
}

static void observe() {
    observe_outputs();
    if (core->issued) event(ISSUE, cycle - 2, core->issued_address, 0, 0, 0, 0);
    if (core->stored) event(STORE, cycle - 2, core->stored_address, 0, 0, core->stored_value, 0);
    for (unsigned s = 0; s < SLOTS; s++) {
        if (bits(core->retire, s, 1)) {
            event(RETIRE, cycle, bits(core->retire_address, 16 * s, 16), s, bits(core->retire_register, 10 * s, 10),
                  bits(core->retire_value, 32 * s, 32), bits(core->retire_flags, 3 * s, 3) << 2);
        }
    }
    outputs([](unsigned slot, bool write, uint32_t reg, uint32_t value) {
        if (write) event(PORT, cycle, 0, slot, reg, value, 0);
        if (write) written[reg % OUTPUTS] = true;
    });
    if (core->tick_missed) event(MISSED, cycle, 0, 0, 0, 0, 0);
    if (core->tick_lost) event(LOST, cycle, 0, 0, 0, 0, 0);
    if (core->halted && !was_halted) event(HALT, cycle - 2, 0, 0, 0, 0, 0);
    if (core->fault && !was_fault) event(FAULT, cycle - 2, core->fault_address, core->fault_slot, core->fault_kind, 0, 0);
    was_halted = core->halted;
    was_fault = core->fault;
}

static void clock(bool watch) {
    core->clk = 0;
    core->eval();
    dump(0);
    if (watch) observe();
    // The memory's write port itself: whatever is written shows here, in the cycle before it is there.
    if (core->stored) data_memory.set(core->stored_address, core->stored_value);
    core->clk = 1;
    core->eval();
    dump(1);
    cycle++;
}

static bool word(uint32_t &value) {
    return fread(&value, sizeof value, 1, stdin) == 1;
}

static uint32_t need() {
    uint32_t value;
    if (!word(value)) {
        fprintf(stderr, "a command is cut short\n");
        exit(1);
    }
    return value;
}

static void load() {
    core->rst = 1;
    core->tick = 0;
    core->load = 0;
    core->input_write = 0;
    cycle = INT64_MIN / 2;
    for (unsigned i = 0; i < RESET_CYCLES; i++) clock(false);
    for (uint32_t count = need(); count > 0; count--) {
        uint32_t space = need(), slot = need(), address = need(), low = need(), high = need();
        uint64_t value = uint64_t(high) << 32 | low;
        std::size_t place = std::size_t(address) * SLOTS + slot;
        if (space == PROGRAM && program_memory.holds(place, value)) continue;
        if (space == DATA && data_memory.holds(address, value)) continue;
        if (space == PROGRAM) program_memory.set(place, value);
        core->load = space != INPUT;
        core->load_space = space & 3;
        core->load_slot = slot;
        core->load_address = address;
        core->load_value = value;
        core->input_write = space == INPUT;
        core->input_index = address;
        core->input_value = low;
        clock(false);
    }
    core->load = 0;
    core->input_write = 0;
    for (unsigned i = 0; i < 8; i++) clock(false);
    core->rst = 0;
    cycle = 0;
    events.clear();
    was_halted = was_fault = false;
    for (unsigned n = 0; n < OUTPUTS; n++) written[n] = known[n] = false;
}

static void run() {
    uint32_t until = need(), count = need();
    std::vector<uint32_t> pins(4 * size_t(count));
    if (fread(pins.data(), 4, pins.size(), stdin) != pins.size()) exit(1);
    size_t next = 0;
    while (cycle < int64_t(until)) {
        core->tick = 0;
        core->input_write = 0;
        for (; next < pins.size() && int64_t(int32_t(pins[next])) <= cycle; next += 4) {
            if (pins[next + 1] == 1) {
                core->tick = 1;
            } else {
                core->input_write = 1;
                core->input_index = pins[next + 2];
                core->input_value = pins[next + 3];
            }
        }
        clock(true);
    }
    uint32_t size = events.size();
    fwrite(&size, sizeof size, 1, stdout);
    fwrite(events.data(), sizeof(Event), events.size(), stdout);
    fflush(stdout);
    events.clear();
}

int main(int argc, char **argv) {
    context.commandArgs(argc, argv);
    // Registers start with random values: what reset does not clear must not matter.
    context.randReset(2);
    context.randSeed(1);
#ifdef TRACE
    context.traceEverOn(true);
#endif
    core = new Vcore(&context);
#ifdef TRACE
    waveform = new VerilatedVcdC;
    core->trace(waveform, 99);
    waveform->open(argc > 1 ? argv[1] : "wave.vcd");
#endif
    core->clk = 0;
    for (uint32_t command; word(command);) {
        switch (command) {
        case 1: load(); break;
        case 2: run(); break;
        case 3:
            trace_first = need();
            trace_last = need();
            break;
        default: fprintf(stderr, "unknown command %u\n", command); return 1;
        }
    }
#ifdef TRACE
    waveform->close();
#endif
    return 0;
}
