// SPDX-License-Identifier: MIT OR Apache-2.0
// Runs one program on the simulated core: program.hex, in the folder where it is started. Prints the cycles between the first two marks, and the results' words.
#include <cstdio>
#include "Vothers.h"
#include "verilated.h"

// Cycles after which a program is given up.
constexpr long LIMIT = 20'000'000;

double sc_time_stamp() { return 0; }

int main()
{
    Verilated::randReset(0);
    Vothers top;
    long begun = 0;
    for (long cycle = 0; cycle < LIMIT; cycle++) {
        top.resetn = cycle > 4;
        top.clk = 0;
        top.eval();
        top.clk = 1;
        top.eval();
        if (top.shown)
            std::printf("result %08x\n", top.value);
        if (top.marked && top.value == 1)
            begun = cycle;
        if (top.marked && top.value == 2)
            std::printf("cycles %ld\n", cycle - begun);
        if (top.marked && top.value == 3)
            return 0;
    }
    std::fprintf(stderr, "no end after %ld cycles\n", LIMIT);
    return 1;
}
