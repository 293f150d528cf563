// Flips bits of a core, or of a pair, one at a time, and reports what became of each: the counterpart of `flips.rs`.
//
// A stand-in for takt_exchange writes the input ports at each tick and reads the output ports when the program publishes. A first run
// without a flip records, for each cycle, what leaves the first core, and every STEP cycles the state. A flip starts from a recorded
// state. The run ends when the state is a recorded one again, when nothing more can be learned, or HORIZON periods after the flip.
//
// stdin, words of 32 bits, little-endian:
//   records count, then (space, slot, address, low, high) each; inputs count, their numbers; outputs count, their numbers, and for each
//   whether it is a float; cycles of a period; periods; a row of inputs for each period; horizon in periods;
//   after the answer, for each flip: cycle, count of bits, and for each its register and its number; or ffffffff to end
// stdout:
//   count of registers, then for each bits, words of a memory (0: flip-flops), length of the name, the name a character a word;
//   first and last cycle for a flip; then for each flip: cycle of the first difference of what leaves the (first) core, cycle of `differs` or
//   `upset`,
//   cycle in which the first core itself stops or misses its deadline, or shows a NaN (0 for none: cycles start at 1); 1 if the state was
//   as if there had been no flip; 1 if a word was corrected

#include "Vcircuit.h"
#include "verilated.h"
#include "verilated_sym_props.h"
#include "verilated_syms.h"
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <string>
#include <vector>

static const unsigned STEP = 64;

static VerilatedContext context;
static Vcircuit *top;

static uint32_t need() {
    uint32_t value;
    if (fread(&value, sizeof value, 1, stdin) != 1) exit(1);
    return value;
}

static std::vector<uint32_t> need(size_t count) {
    std::vector<uint32_t> words(count);
    for (uint32_t &value : words) value = need();
    return words;
}

static void put(uint32_t value) {
    fwrite(&value, sizeof value, 1, stdout);
}

[[noreturn]] static void fails(const char *text, uint64_t cycle) {
    fprintf(stderr, "%s in cycle %llu\n", text, (unsigned long long)cycle);
    exit(1);
}

// ---- the registers

struct Register {
    std::string name;
    uint8_t *data;
    unsigned bits, words;  // words: of a memory; 0 for flip-flops
    size_t size, entry;    // bytes, and those of a word
    bool first;            // it is the first core's
    bool counts;           // it counts corrections, and nothing follows from it
};
static std::vector<Register> registers;

static void find_registers() {
    std::map<std::string, Register> sorted;
    for (const auto &scope : *context.scopeNameMap()) {
        const VerilatedVarNameMap *vars = scope.second->varsp();
        if (!vars) continue;
        std::string path = scope.first;
        size_t at = path.find(TOP);
        if (at == std::string::npos) continue;
        path = path.substr(at + sizeof TOP - 1);
        if (!path.empty()) path = path.substr(1) + ".";
        for (const auto &entry : *vars) {
            const VerilatedVar &var = entry.second;
            if (!var.isPublicRW() || var.isParam() || (var.vldir() & VLVF_MASK_DIR) == VLVD_IN) continue;
            Register own;
            own.name = path + entry.first;
            own.data = static_cast<uint8_t *>(var.datap());
            own.bits = var.dims() - var.udims() ? var.packed().elements() : 1;
            own.words = var.udims() ? var.unpacked().elements() : 0;
            own.size = var.totalSize();
            own.entry = var.udims() ? own.size / own.words : own.size;
#ifdef PAIR
            own.first = own.name.compare(0, 6, "first.") == 0;
#else
            own.first = true;
#endif
            own.counts = own.name.find("report.corrections") != std::string::npos;
            sorted[own.name] = own;
        }
    }
    for (auto &entry : sorted) registers.push_back(entry.second);
}

// ---- what is around the pair

static std::vector<uint32_t> input_numbers, output_numbers, output_floats, rows;
static uint32_t period, periods, horizon;

enum Phase { REST, INPUTS, BEGINS, RUNS, OUTPUTS, PUTS };

struct Around {
    uint32_t phase, number, rest, row, handed, ready, until_tick, ticks;
};
static Around around;

// What leaves the first core in a cycle.
struct Left {
    uint32_t phase, number, value, stored, address, word;
    bool operator!=(const Left &other) const { return memcmp(this, &other, sizeof *this) != 0; }
};

struct Seen {
    Left left;
    bool told, stops, corrected;
};

static Seen pass() {
    Around &a = around;
    bool tick = a.ready && a.until_tick == 0;
    a.until_tick = a.ready ? (tick ? period : a.until_tick) - 1 : 0;
    top->clk = 0;
    top->input_write = a.phase == INPUTS && a.number < input_numbers.size();
    if (top->input_write) {
        top->input_index = input_numbers[a.number];
        top->input_value = rows[a.row * input_numbers.size() + a.number];
    }
    top->tick = a.phase == INPUTS && a.number == input_numbers.size();
    bool reads = a.phase == OUTPUTS && a.number < output_numbers.size();
    top->read_output = reads ? output_numbers[a.number] : 0;
    top->eval();

    Seen seen;
    uint32_t value = reads ? top->read_value : 0;
    seen.left = {a.phase, a.number, value, top->stored, top->stored ? top->stored_address : 0u, top->stored ? top->stored_value : 0u};
    seen.told = seen.corrected = false;
#ifdef PAIR
    seen.told |= top->differs;
#endif
#ifdef ECC
    seen.told |= top->upset;
    seen.corrected = top->corrections != 0;
#endif
    bool idle = a.phase == REST && top->waiting;
    bool nan = reads && output_floats[a.number] && (value & 0x7fffffff) > 0x7f800000;
    seen.stops = top->fault || top->halted || nan || (tick && !idle);

    a.ready |= top->waiting;
    a.handed |= top->published;
    switch (a.phase) {
    case REST:
        a.number = 0;
        if (tick && top->waiting) {
            a.phase = INPUTS;
            a.row = a.ticks++ % periods;
            a.handed = 0;
        }
        break;
    case INPUTS:
        a.rest = 0;
        if (a.number == input_numbers.size()) a.phase = BEGINS;
        else a.number++;
        break;
    case BEGINS:
        if (a.rest++ == 1) a.phase = RUNS;
        break;
    case RUNS:
        a.number = 0;
        if (top->waiting || top->published || a.handed) a.phase = OUTPUTS;
        break;
    case OUTPUTS:
        a.rest = 0;
        if (a.number == output_numbers.size()) a.phase = PUTS;
        else a.number++;
        break;
    default:
        if (a.rest++ == 3) a.phase = REST;
        break;
    }
    top->clk = 1;
    top->eval();
    return seen;
}

// ---- recorded states

struct State {
    std::vector<uint8_t> bytes;
    Around around;
};
static std::vector<State> states;  // of the cycles 0, STEP, …
static std::vector<Left> golden;   // of each cycle

static State keep() {
    State state;
    size_t size = 0;
    for (const Register &own : registers) size += own.size;
    state.bytes.resize(size);
    uint8_t *to = state.bytes.data();
    for (const Register &own : registers) {
        memcpy(to, own.data, own.size);
        to += own.size;
    }
    state.around = around;
    return state;
}

static void restore(const State &state) {
    const uint8_t *from = state.bytes.data();
    for (const Register &own : registers) {
        memcpy(own.data, from, own.size);
        from += own.size;
    }
    around = state.around;
}

// Whether the state is a recorded one; `first`: what of it can make the first core differ.
static bool is(const State &state, bool first) {
    if (memcmp(&around, &state.around, sizeof around)) return false;
    const uint8_t *at = state.bytes.data();
    for (const Register &own : registers) {
        if ((!first || own.first) && !own.counts && memcmp(own.data, at, own.size)) return false;
        at += own.size;
    }
    return true;
}

static void load() {
    top->rst = 1;
    auto step = [] {
        top->clk = 0;
        top->eval();
        top->clk = 1;
        top->eval();
    };
    for (unsigned i = 0; i < RESET_CYCLES; i++) step();
    for (uint32_t count = need(); count > 0; count--) {
        uint32_t space = need(), slot = need(), address = need(), low = need(), high = need();
        top->load = space != 3;
        top->load_space = space & 3;
        top->load_slot = slot;
        top->load_address = address;
        top->load_value = uint64_t(high) << 32 | low;
        top->input_write = space == 3;
        top->input_index = address;
        top->input_value = low;
        step();
    }
    top->load = 0;
    top->input_write = 0;
    for (unsigned i = 0; i < RESET_CYCLES; i++) step();
    top->rst = 0;
}

int main(int argc, char **argv) {
    context.commandArgs(argc, argv);
    context.randReset(2);
    context.randSeed(1);
    top = new Vcircuit(&context);
    find_registers();
    load();
    input_numbers = need(need());
    output_numbers = need(need());
    output_floats = need(output_numbers.size());
    period = need();
    periods = need();
    rows = need(size_t(periods) * input_numbers.size());
    horizon = need();

    // The run without a flip: a period more than the inputs have rows for, so that what is kept from one to the next is in it.
    around = {};
    size_t cycles = (size_t(periods) + horizon + 2) * period;
    size_t ready = 0;
    for (size_t cycle = 0; cycle < cycles + ready; cycle++) {
        if (cycle % STEP == 0) states.push_back(keep());
        Seen seen = pass();
        if (!around.ready) ready = cycle + 1;
        if (seen.told || seen.corrected) fails("without a flip, a mechanism tells", cycle);
        if (seen.stops) fails("without a flip, the program stops or misses its deadline", cycle);
        if (ready > 1000000) fails("the program does not wait", cycle);
        golden.push_back(seen.left);
    }
    // A recorded state must be all that there is.
    for (size_t i : {states.size() / 2, states.size() / 3}) {
        restore(states[i]);
        for (size_t cycle = i * STEP; cycle < (i + 1) * STEP; cycle++) {
            if (pass().left != golden[cycle]) fails("after a restored state, the run is another one", cycle);
        }
        if (!is(states[i + 1], false)) fails("after a restored state, the next one is another one", (i + 1) * STEP);
    }

    put(registers.size());
    for (const Register &own : registers) {
        put(own.bits);
        put(own.words);
        put(own.name.size());
        for (char letter : own.name) put(uint8_t(letter));
    }
    size_t last = golden.size() - size_t(horizon + 1) * period;
    put(ready + period);
    put(last);
    fflush(stdout);

    for (uint32_t from; (from = need()) != 0xffffffff;) {
        std::vector<uint32_t> bits = need(2 * size_t(need()));
        restore(states[from / STEP]);
        for (size_t cycle = from / STEP * STEP; cycle < from; cycle++) pass();
        for (size_t i = 0; i < bits.size(); i += 2) {
            const Register &own = registers.at(bits[i]);
            size_t bit = bits[i + 1];
            own.data[bit / own.bits * own.entry + bit % own.bits / 8] ^= 1 << bit % own.bits % 8;
        }
        uint32_t harmful = 0, told = 0, stops = 0, same = 0, corrected = 0;
        size_t end = size_t(from) + size_t(horizon) * period;
        for (size_t cycle = from; cycle < end; cycle++) {
            if (cycle > from && cycle % STEP == 0) {
                const State &state = states[cycle / STEP];
                same = is(state, false);
                if (same || (told && is(state, true))) break;
            }
            Seen seen = pass();
            if (!harmful && seen.left != golden[cycle]) {
                harmful = cycle + 1;
                end = cycle + period;  // in which it may be told
            }
            if (!told && seen.told) told = cycle + 1;
            corrected |= seen.corrected;
            if (!stops && seen.stops) stops = cycle + 1;
            // A mechanism has told; the core's own means may still come.
            if (harmful && told && stops) break;
        }
        put(harmful);
        put(told);
        put(stops);
        put(same);
        put(corrected);
        fflush(stdout);
    }
    return 0;
}
