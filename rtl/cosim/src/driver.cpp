// Simulates a circuit for a host: the counterpart of `simulation.rs`.
//
// stdin, words of 32 bits, little-endian:
//   1 run    until, count, then that many (cycle, pin, value): the value stands on the pin from that cycle on; a strobe is high
//            for that cycle
//   2 trace  first, last: writes a waveform of these cycles (built with -DTRACE)
//   3 load   for a core only: see core.h
// stdout, for each run: a count and that many events of 8 words:
//   kind, cycle, address, slot, register, value, flags, place (the core, or the link for kinds from LINK on)
// and then the value of each of PINS pins in cycle `until`. Cycle 0 is the first in which the cores run.
//
// circuit.h defines PINS, set_pin, pin, clear_strobes, look, reset and load: a generated part, followed by core.h or system.h.

#include "Vcircuit.h"
#include "verilated.h"
#ifdef TRACE
#include "verilated_vcd_c.h"
#endif
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

// Kinds of events, in the order of `EventKind` in event.rs, followed by the kinds for links.
enum Kind { ISSUE, STORE, RETIRE, PORT, MISSED, LOST, HALT, FAULT, PUBLISH, INPUT, LINK };
enum LinkKind { VALUE = LINK, PUBLISHED, TAKEN, SKIPPED, PUSHED, POPPED, OVERFLOWS, UNDERFLOWS };

// place: the core, or the link for kinds from LINK on.
struct Event {
    uint32_t kind, cycle, address, slot, reg, value, flags, place;
};

static VerilatedContext context;
static Vcircuit *top;
static int64_t cycle;
static std::vector<Event> events;

static void event(uint32_t kind, int64_t at, uint32_t address, uint32_t slot, uint32_t reg, uint32_t value, uint32_t flags,
                  uint32_t place) {
    events.push_back({kind, uint32_t(at), address, slot, reg, value, flags, place});
}

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

// ---- a core's nets, of these names behind a prefix

struct Was {
    bool halted, fault;
};

#define OBSERVE_CORE(core, slots, p, was)                                                                                  \
    do {                                                                                                                   \
        if (top->p##issued) event(ISSUE, cycle - 2, top->p##issued_address, 0, 0, 0, 0, core);                             \
        if (top->p##stored) event(STORE, cycle - 2, top->p##stored_address, 0, 0, top->p##stored_value, 0, core);          \
        for (unsigned s = 0; s < slots; s++) {                                                                             \
            if (bits(top->p##retire, s, 1)) {                                                                              \
                event(RETIRE, cycle, bits(top->p##retire_address, 16 * s, 16), s, bits(top->p##retire_register, 10 * s, 10), \
                      bits(top->p##retire_value, 32 * s, 32), bits(top->p##retire_flags, 3 * s, 3) << 2, core);            \
            }                                                                                                              \
        }                                                                                                                  \
        if (top->p##tick_missed) event(MISSED, cycle, 0, 0, 0, 0, 0, core);                                                \
        if (top->p##tick_lost) event(LOST, cycle, 0, 0, 0, 0, 0, core);                                                    \
        if (top->p##halted && !was.halted) event(HALT, cycle - 2, 0, 0, 0, 0, 0, core);                                    \
        if (top->p##fault && !was.fault) {                                                                                 \
            event(FAULT, cycle - 2, top->p##fault_address, top->p##fault_slot, top->p##fault_kind, 0, 0, core);            \
        }                                                                                                                  \
        was = {bool(top->p##halted), bool(top->p##fault)};                                                                 \
    } while (0)

#define OBSERVE_PORT(core, slot, write, reg, value)                                                                        \
    if (write) event(PORT, cycle, 0, slot, reg, value, 0, core)

#define OBSERVE_INPUT(core, write, reg, value)                                                                             \
    if (write) event(INPUT, cycle, 0, 0, reg, value, 0, core)

#define OBSERVE_LINK(link, kind, happens, value)                                                                           \
    if (happens) event(kind, cycle, 0, 0, 0, value, 0, link)

// ---- cycles, and the waveform of some

static uint32_t trace_first = 1, trace_last = 0;
#ifdef TRACE
static VerilatedVcdC *waveform;
#endif

static void dump(int edge) {
#ifdef TRACE
    if (cycle >= int64_t(trace_first) && cycle <= int64_t(trace_last)) waveform->dump(uint64_t(cycle) * 2 + edge);
#else
    (void)edge;
#endif
}

// Simulates a cycle. `look` is called in its middle, when all nets are stable.
template <class F> static void clock(F look) {
    top->clk = 0;
    top->eval();
    dump(0);
    look();
    top->clk = 1;
    top->eval();
    dump(1);
    cycle++;
}

static void start(int argc, char **argv) {
    context.commandArgs(argc, argv);
    // Registers start with random values: what reset does not clear must not matter.
    context.randReset(2);
    context.randSeed(1);
#ifdef TRACE
    context.traceEverOn(true);
#endif
    top = new Vcircuit(&context);
#ifdef TRACE
    waveform = new VerilatedVcdC;
    top->trace(waveform, 99);
    waveform->open(argc > 1 ? argv[1] : "wave.vcd");
#else
    (void)argc;
    (void)argv;
#endif
}

static int finish() {
#ifdef TRACE
    waveform->close();
#endif
    return 0;
}

// ---- words

// Reads a word; false at the end of input.
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

static std::vector<uint32_t> need(std::size_t count) {
    std::vector<uint32_t> words(count);
    for (uint32_t &value : words) value = need();
    return words;
}

static void put(uint32_t value) {
    fwrite(&value, sizeof value, 1, stdout);
}

// Sends the number of events and the events, and clears them.
static void put_events() {
    put(events.size());
    fwrite(events.data(), sizeof(Event), events.size(), stdout);
    events.clear();
}


// ---- the circuit

// Simulates a cycle; records its events if `watch` is true.
static void pass(bool watch);

// Clears the strobes and updates the nets that depend on pins.
static void settle();

#include "circuit.h"

static void pass(bool watch) {
    clock([watch] { look(watch); });
}

static void settle() {
    clear_strobes();
    top->clk = 0;
    top->eval();
}

// ---- commands

static void run() {
    uint32_t until = need(), count = need();
    std::vector<uint32_t> pins = need(3 * size_t(count));
    size_t next = 0;
    while (cycle < int64_t(until)) {
        clear_strobes();
        for (; next < pins.size() && int64_t(pins[next]) <= cycle; next += 3) set_pin(pins[next + 1], pins[next + 2]);
        pass(true);
    }
    settle();
    put_events();
    for (unsigned i = 0; i < PINS; i++) put(pin(i));
    fflush(stdout);
}

int main(int argc, char **argv) {
    start(argc, argv);
    reset();
    for (uint32_t command; word(command);) {
        switch (command) {
        case 1: run(); break;
        case 2:
            trace_first = need();
            trace_last = need();
            break;
        case 3: load(); break;
        default: fprintf(stderr, "unknown command %u\n", command); return 1;
        }
    }
    return finish();
}
