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
#define MODEL Vcore
#include "driver.h"
#include "ports.h"

// As `takt_rtl::bench::Space`.
enum Space { TO_PROGRAM, TO_DATA, TO_REGISTER, TO_INPUT };

static Was was;
// Of each output port: whether it was written since the last `wait`, and ever before that, and what it showed then.
static bool written[OUTPUTS], known[OUTPUTS];
static uint32_t shown[OUTPUTS];

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

static uint32_t read_output(unsigned number) {
    top->read_output = number;
    top->eval();
    return top->read_value;
}

// What the outside sees: after a `wait`, all that was written; if ports are latched, nothing else in between.
static void observe_outputs() {
    if (top->ended) {
        for (unsigned n = 0; n < OUTPUTS; n++) {
            if (!written[n] && !known[n]) continue;
            uint32_t value = read_output(n);
            if (written[n] || value != shown[n]) event(PUBLISH, cycle - 2, 0, 0, n, value, 0, 0);
            shown[n] = value;
            known[n] = true;
            written[n] = false;
        }
    } else if (LATCHED) {
        unsigned n = cycle % OUTPUTS;
        if (known[n] && read_output(n) != shown[n]) event(PUBLISH, cycle, 0, 0, n, top->read_value, 0, 0);
    }
}

static void observe() {
    observe_outputs();
    OBSERVE_CORE(0, SLOTS, , was);
    outputs([](unsigned slot, bool write, uint32_t reg, uint32_t value) {
        OBSERVE_PORT(0, slot, write, reg, value);
        if (write) written[reg % OUTPUTS] = true;
    });
}

static void pass(bool watch) {
    clock([watch] {
        if (watch) observe();
        // The memory's write port itself: whatever is written shows here, in the cycle before it is there.
        if (top->stored) data_memory.set(top->stored_address, top->stored_value);
    });
}

static void load() {
    top->rst = 1;
    top->tick = 0;
    top->load = 0;
    top->input_write = 0;
    cycle = INT64_MIN / 2;
    for (unsigned i = 0; i < RESET_CYCLES; i++) pass(false);
    for (uint32_t count = need(); count > 0; count--) {
        uint32_t space = need(), slot = need(), address = need(), low = need(), high = need();
        uint64_t value = uint64_t(high) << 32 | low;
        std::size_t place = std::size_t(address) * SLOTS + slot;
        if (space == TO_PROGRAM && program_memory.holds(place, value)) continue;
        if (space == TO_DATA && data_memory.holds(address, value)) continue;
        if (space == TO_PROGRAM) program_memory.set(place, value);
        top->load = space != TO_INPUT;
        top->load_space = space & 3;
        top->load_slot = slot;
        top->load_address = address;
        top->load_value = value;
        top->input_write = space == TO_INPUT;
        top->input_index = address;
        top->input_value = low;
        pass(false);
    }
    top->load = 0;
    top->input_write = 0;
    for (unsigned i = 0; i < 8; i++) pass(false);
    top->rst = 0;
    cycle = 0;
    events.clear();
    was = {};
    for (unsigned n = 0; n < OUTPUTS; n++) written[n] = known[n] = false;
}

static void run() {
    uint32_t until = need(), count = need();
    std::vector<uint32_t> pins = need(4 * size_t(count));
    size_t next = 0;
    while (cycle < int64_t(until)) {
        top->tick = 0;
        top->input_write = 0;
        for (; next < pins.size() && int64_t(int32_t(pins[next])) <= cycle; next += 4) {
            if (pins[next + 1] == 1) {
                top->tick = 1;
            } else {
                top->input_write = 1;
                top->input_index = pins[next + 2];
                top->input_value = pins[next + 3];
            }
        }
        pass(true);
    }
    put_events();
    fflush(stdout);
}

int main(int argc, char **argv) {
    start(argc, argv);
    top->clk = 0;
    for (uint32_t command; word(command);) {
        switch (command) {
        case 1: load(); break;
        case 2: run(); break;
        case 3: need_trace(); break;
        default: return unknown(command);
        }
    }
    return finish();
}
