// Runs a system in simulation for a host: the other half of `model.rs`.
//
// stdin, words of 32 bits, little-endian:
//   1 run    until, count, then that many (cycle, pin, value): what stands on a pin of the host's from that cycle on; a strobe is
//            high for that cycle
//   2 trace  first, last: writes a waveform of these cycles (built with -DTRACE)
// stdout, for each run: a count and that many events of 8 words:
//   kind, cycle, address, slot, register, value, flags, place: the core, or the link for kinds from LINK on
// and then the value of each pin of the host's, as it stands in cycle `until`. Cycle 0 is the first in which the cores run.
//
// system.h, which is generated, gives PINS, set_pin, pin, clear_strobes, and observe, which calls what is below.

#include "Vsystem.h"
#define MODEL Vsystem
#include "driver.h"

enum LinkKind { VALUE = LINK, PUBLISHED, TAKEN, SKIPPED, PUSHED, POPPED, OVERFLOWS, UNDERFLOWS };

#define OBSERVE_INPUT(core, write, reg, value)                                                                             \
    if (write) event(INPUT, cycle, 0, 0, reg, value, 0, core)

#define OBSERVE_LINK(link, kind, happens, value)                                                                           \
    if (happens) event(kind, cycle, 0, 0, 0, value, 0, link)

#include "system.h"

static void pass(bool watch) {
    clock([watch] {
        if (watch) observe();
    });
}

static void run() {
    uint32_t until = need(), count = need();
    std::vector<uint32_t> pins = need(3 * size_t(count));
    size_t next = 0;
    while (cycle < int64_t(until)) {
        clear_strobes();
        for (; next < pins.size() && int64_t(pins[next]) <= cycle; next += 3) set_pin(pins[next + 1], pins[next + 2]);
        pass(true);
    }
    clear_strobes();
    top->clk = 0;
    top->eval();
    put_events();
    for (unsigned i = 0; i < PINS; i++) put(pin(i));
    fflush(stdout);
}

int main(int argc, char **argv) {
    start(argc, argv);
    cycle = INT64_MIN / 2;
    clear_strobes();
    for (unsigned i = 0; i < PINS; i++) set_pin(i, 0);
    clear_strobes();
    top->rst = 1;
    for (unsigned i = 0; i < 4; i++) pass(false);
    top->rst = 0;
    top->clk = 0;
    top->eval();
    while (!top->running) {
        pass(false);
        top->clk = 0;
        top->eval();
    }
    cycle = 0;
    for (uint32_t command; word(command);) {
        switch (command) {
        case 1: run(); break;
        case 2: need_trace(); break;
        default: return unknown(command);
        }
    }
    return finish();
}
