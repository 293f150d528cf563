// Runs a board's top level for a host: the other half of `simulation.rs`.
//
// stdin, words of 32 bits, little-endian; one command:
//   cycles, faults, then for each input pin its level (0, 1), or 2 + n if it is wired to output pin n, whose level it has a cycle later;
//   then a count and that many encoders (pin a, pin b, count, difference):
//   in these cycles the encoder goes that far, evenly; then a count and that many bytes, a word each, which follow those not sent yet
//   on the UART; then a count and that many output pins, each with its edges (1: rises, 2: falls): the run ends with the first cycle in
//   which one of these comes. The pin OUTPUTS is the board's tick. faults: 1 in so many bits of the UART, in either direction, is turned;
//   0: none.
// stdout: the cycles that were run, whether the last of them has the board's tick, and of the pins watched those with an edge in it, as
// bits; a count and that many bytes that came from the UART, a word each; for each output pin the cycles in which it was 1, and its level;
// a count and that many words of `see`; a count and that many moments in which outputs of a core became safe, or trips rose: the cycle, the
// core, and the words of `look` but the first. The last word has the trips that rose; it is 0 where outputs of the core became safe.
//
// pins.h, which is generated, gives UART, which is 0 for a board without one, DIVIDE, INPUTS, OUTPUTS and the pins; watch.h CORES and look,
// whose first word is whether a core's outputs drive, ticks, and see with SEEN, the registers that the program reads. Of a circuit that is not
// watched, CORES and SEEN are 0.

#include "Vtop.h"
#include "Vtop___024root.h"
#include "verilated.h"
#include <cstdint>
#include <cstdio>
#include <deque>
#include <vector>

static uint32_t bits(uint64_t value, unsigned low, unsigned width) {
    return uint32_t(value >> low & ((uint64_t(1) << width) - 1));
}

template <std::size_t N> static uint32_t bits(const VlWide<N> &value, unsigned low, unsigned width) {
    uint32_t result = 0;
    for (unsigned i = 0; i < width; i++) result |= uint32_t(value.at((low + i) / 32) >> (low + i) % 32 & 1) << i;
    return result;
}

#include "pins.h"
#include "watch.h"

#if UART
static void to_board(Vtop &top, uint32_t level) { top.uart_receive = level; }
static uint32_t from_board(const Vtop &top) { return top.uart_send; }
#else
static void to_board(Vtop &, uint32_t) {}
static uint32_t from_board(const Vtop &) { return 1; }
#endif

static const unsigned LOOKED = 9;   // words of `look`
#if CORES == 0
static void look(Vtop *, unsigned, uint32_t *) {}
static bool ticks(Vtop *) { return false; }
static void see(Vtop *, uint32_t *) {}
#endif

static uint64_t seed = 88172645463325252ull;
static uint32_t chance() {
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    return uint32_t(seed >> 32);
}

static bool word(uint32_t &value) { return fread(&value, sizeof value, 1, stdin) == 1; }

#ifdef FLASH_SELECT
// A flash, in the file flash.bin of the working folder: reading, programming, erasing of 4 kB, identification, status. After as many
// changes of bytes as the file flash.life says, its power goes: nothing changes any more.
struct Flash {
    std::FILE *file = nullptr;
    std::vector<uint8_t> bytes = std::vector<uint8_t>(1 << 24, 0xff);
    uint64_t life = ~uint64_t(0);
    uint32_t busy = 0, bits = 0, count = 0, shift = 0, out = 0xff;
    uint32_t address = 0;
    uint8_t command = 0;
    bool clock = false, enabled = false, drives = true;
    std::vector<uint8_t> data;

    void open(const char *name) {
        file = std::fopen(name, "r+b");
        if (!file) file = std::fopen(name, "w+b");
        if (file) (void)!std::fread(bytes.data(), 1, bytes.size(), file);
    }
    void put(uint32_t at, uint8_t value) {
        if (life == 0) return;
        life--;
        at &= (1 << 24) - 1;
        bytes[at] = value;
        if (!file) return;
        // Bytes before the file's end that were never written are erased ones.
        std::fseek(file, 0, SEEK_END);
        for (long end = std::ftell(file); end < long(at); end++) std::fputc(bytes[end], file);
        std::fseek(file, at, SEEK_SET);
        std::fputc(value, file);
    }
    void act() {
        if (command == 0x06) enabled = true;
        if (count < 4 || !enabled || (command != 0x02 && command != 0x20)) return;
        enabled = false;
        busy = 3000;
        if (command == 0x02)
            for (std::size_t i = 0; i < data.size(); i++) {
                uint32_t at = (address & ~255u) | (uint32_t(address + i) & 255);
                put(at, bytes[at] & data[i]);
            }
        else
            for (uint32_t i = 0; i < 4096; i++) put((address & ~4095u) + i, 0xff);
        if (file) std::fflush(file);
    }
    uint8_t answer() {
        if (command == 0x05) return uint8_t((busy > 0) | enabled << 1);
        if (busy) return 0xff;
        if (command == 0x9f) return count == 1 ? 0xef : count == 2 ? 0x40 : 0x18;
        if (command == 0x03 && count >= 4) return bytes[(address + count - 4) & ((1 << 24) - 1)];
        return 0xff;
    }
    // A cycle: levels of the pins, and the level that the flash drives.
    uint8_t cycle(bool select, bool next, bool in) {
        if (busy) busy--;
        if (select) {
            if (count && !busy) act();
            bits = count = 0;
            data.clear();
        } else if (next && !clock) {
            shift = shift << 1 | in;
            if (++bits == 8) {
                uint8_t byte = uint8_t(shift);
                if (count == 0) command = byte;
                else if (count < 4) address = (address << 8 | byte) & 0xffffff;
                else if (command == 0x02) data.push_back(byte);
                bits = 0;
                count++;
                out = answer();
            }
        }
        if (!next && clock) drives = out >> (7 - bits) & 1;
        clock = next;
        return drives;
    }
};
#endif

struct Encoder {
    uint32_t a, b, count;
    int32_t difference;
};

int main(int argc, char **argv) {
    VerilatedContext context;
    context.commandArgs(argc, argv);
    context.randReset(2);
    context.randSeed(1);
    Vtop top(&context);
    CData *inputs[INPUTS + 1], *outputs[OUTPUTS + 1];
    input_pins(&top, inputs);
    output_pins(&top, outputs);
    top.clk_in = 0;
    to_board(top, 1);
#ifdef FLASH_SELECT
    Flash flash;
    if (std::FILE *life = std::fopen("flash.life", "r")) {
        unsigned long long bytes;
        if (std::fscanf(life, "%llu", &bytes) == 1) flash.life = bytes;
        std::fclose(life);
    }
    flash.open("flash.bin");
#endif
    std::deque<uint32_t> sends;
    uint32_t shift = 0, bits = 0, left = 0;              // what is being sent to the board
    uint32_t got = 0, got_bits = 0, got_left = 0;        // what comes from it
    uint32_t drove[CORES + 1] = {}, held = 0;
    for (uint32_t cycles; word(cycles);) {
        uint32_t faults, count, value;
        if (!word(faults)) return 1;
        std::vector<std::pair<CData *, const CData *>> wires;
        for (unsigned i = 0; i < INPUTS; i++) {
            if (!word(value) || value >= 2 + OUTPUTS) return 1;
            if (value < 2)
                *inputs[i] = value;
            else
                wires.push_back({inputs[i], outputs[value - 2]});
        }
        std::vector<Encoder> encoders;
        if (!word(count)) return 1;
        for (; count > 0; count--) {
            Encoder e;
            uint32_t difference;
            if (!word(e.a) || !word(e.b) || !word(e.count) || !word(difference)) return 1;
            e.difference = int32_t(difference);
            if (e.a >= INPUTS || e.b >= INPUTS) return 1;
            encoders.push_back(e);
        }
        if (!word(count)) return 1;
        for (; count > 0; count--) {
            if (!word(value)) return 1;
            sends.push_back(value);
        }
        std::vector<std::pair<uint32_t, uint32_t>> watched;
        uint32_t tick_ends = 0;
        if (!word(count)) return 1;
        for (; count > 0; count--) {
            uint32_t pin, kinds;
            if (!word(pin) || !word(kinds) || pin > OUTPUTS) return 1;
            if (pin == OUTPUTS)
                tick_ends = 1;
            else
                watched.push_back({pin, kinds});
        }
        std::vector<uint32_t> answer, high(OUTPUTS), moments;
        std::vector<uint32_t> edges((watched.size() + 31) / 32);
        uint32_t cycle = 0, has_tick = 0;
        for (bool ends = false; cycle < cycles && !ends; cycle++) {
            // An edge that waits for no clock comes before the clock's.
            uint8_t before[OUTPUTS + 1];
            for (const auto &pin : watched) before[pin.first] = *outputs[pin.first];
            for (const Encoder &e : encoders) {
                uint32_t at = e.count + uint32_t(int64_t(e.difference) * (int64_t(cycle) + 1) / int64_t(cycles));
                *inputs[e.a] = (at + 1) >> 1 & 1;
                *inputs[e.b] = at >> 1 & 1;
            }
            for (const auto &wire : wires) *wire.first = *wire.second;
            if (bits == 0 && !sends.empty()) {
                shift = sends.front() << 1 | 1u << 9;
                sends.pop_front();
                if (faults && chance() % faults < 10) shift ^= 1u << chance() % 10;
                bits = 10;
                left = DIVIDE;
            }
#ifdef FLASH_SELECT
            FLASH_IN = flash.cycle(FLASH_SELECT, FLASH_CLOCK, FLASH_OUT);
#endif
            to_board(top, bits ? shift & 1 : 1);
            if (bits && --left == 0) {
                shift >>= 1;
                bits--;
                left = DIVIDE;
            }
            top.clk_in = 0;
            top.eval();
            for (unsigned i = 0; i < OUTPUTS; i++) high[i] += *outputs[i];
            for (unsigned core = 0; core < CORES; core++) {
                uint32_t words[LOOKED];
                look(&top, core, words);
                uint32_t trips = core ? 0 : words[LOOKED - 1] & ~held;
                if (!core) held = words[LOOKED - 1];
                auto tell = [&](uint32_t risen) {
                    words[LOOKED - 1] = risen;
                    moments.insert(moments.end(), {cycle, core});
                    moments.insert(moments.end(), words + 1, words + LOOKED);
                };
                if (trips) tell(trips);
                if (drove[core] && !words[0]) tell(0);
                drove[core] = words[0];
            }
            if (got_bits == 0) {
                if (!from_board(top)) {
                    got_bits = 10;
                    got_left = DIVIDE / 2;
                    got = 0;
                }
            } else if (--got_left == 0) {
                got = got >> 1 | from_board(top) << 9;
                got_left = DIVIDE;
                if (--got_bits == 0 && got >> 9) {
                    uint32_t byte = got >> 1 & 255;
                    if (faults && chance() % faults < 10) byte ^= 1u << chance() % 8;
                    answer.push_back(byte);
                }
            }
            has_tick = ticks(&top);
            ends = tick_ends & has_tick;
            top.clk_in = 1;
            top.eval();
            for (std::size_t i = 0; i < watched.size(); i++) {
                auto [pin, kinds] = watched[i];
                uint8_t now = *outputs[pin];
                if (now == before[pin] || !(kinds >> (now ? 0 : 1) & 1)) continue;
                edges[i / 32] |= 1u << i % 32;
                ends = true;
            }
        }
        uint32_t size = answer.size();
        fwrite(&cycle, sizeof cycle, 1, stdout);
        fwrite(&has_tick, sizeof has_tick, 1, stdout);
        fwrite(edges.data(), sizeof(uint32_t), edges.size(), stdout);
        fwrite(&size, sizeof size, 1, stdout);
        fwrite(answer.data(), sizeof(uint32_t), answer.size(), stdout);
        fwrite(high.data(), sizeof(uint32_t), high.size(), stdout);
        for (unsigned i = 0; i < OUTPUTS; i++) {
            uint32_t level = *outputs[i];
            fwrite(&level, sizeof level, 1, stdout);
        }
        uint32_t seen[SEEN + 1];
        see(&top, seen);
        size = SEEN;
        fwrite(&size, sizeof size, 1, stdout);
        fwrite(seen, sizeof(uint32_t), SEEN, stdout);
        size = moments.size() / (LOOKED + 1);
        fwrite(&size, sizeof size, 1, stdout);
        fwrite(moments.data(), sizeof(uint32_t), moments.size(), stdout);
        fflush(stdout);
    }
    return 0;
}
