// What the drivers of a core and of a system share: events, words on stdin and stdout, the waveform, what a core's nets mean.
//
// A driver defines MODEL, the class that Verilator makes, and includes its header before this one.

#include "verilated.h"
#ifdef TRACE
#include "verilated_vcd_c.h"
#endif
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

// As `EventKind` in model.rs, then those of links.
enum Kind { ISSUE, STORE, RETIRE, PORT, MISSED, LOST, HALT, FAULT, PUBLISH, INPUT, LINK };

// place: the core, or the link for kinds from LINK on.
struct Event {
    uint32_t kind, cycle, address, slot, reg, value, flags, place;
};

static VerilatedContext context;
static MODEL *top;
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

// A cycle. `look` is called in its middle, where all nets stand.
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
    top = new MODEL(&context);
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

// False at the end.
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

// A count and so many events, which are then forgotten.
static void put_events() {
    put(events.size());
    fwrite(events.data(), sizeof(Event), events.size(), stdout);
    events.clear();
}

static void need_trace() {
    trace_first = need();
    trace_last = need();
}

static int unknown(uint32_t command) {
    fprintf(stderr, "unknown command %u\n", command);
    return 1;
}
