// Drives one unit through batches of operations: the other half of `mod.rs`, which builds it once for each unit.
//
// stdin:  a batch is a count and that many requests; stdout: for each request, a response, in order.
// An operation's operands are on the unit's inputs for one cycle, k; its result must be on the outputs in cycle
// k + LATENCY - 1 with out_valid, and out_valid must be low in every other cycle. When no operation is presented, operands
// and op are random, and so they are in the cycles in which the unit is busy: what is read late gives a wrong result.
//
// Built with -DLATENCY, -DINTERVAL, -DOPERANDS, and -DOP if the unit has an op port.

#include "Vdut.h"
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <vector>

struct Request {
    uint32_t op, a, b, c;
    uint32_t idle; // cycles without an operation before this one, on top of the unit's interval
};

struct Response {
    uint32_t result, flags;
};

// Registers start with random values.
static Vdut &make() {
    Verilated::randReset(2);
    return *new Vdut;
}

static Vdut &dut = make();
static uint64_t cycle = 0;
static uint64_t noise = 0x9e3779b97f4a7c15;

static uint32_t random_bits() {
    noise ^= noise << 13;
    noise ^= noise >> 7;
    noise ^= noise << 17;
    return uint32_t(noise >> 16);
}

// Results are due in order, at most LATENCY of them.
static struct {
    uint64_t at;
    Response *response;
} due[64];
static unsigned due_head = 0, due_tail = 0;

// One cycle. The outputs are read while the inputs of this cycle stand: a path from input to output shows.
static void step(const Request *request, Response *response) {
    dut.clk = 0;
    dut.in_valid = request != nullptr;
#ifdef OP
    dut.op = request ? request->op : random_bits() & ((1u << OP) - 1);
#endif
    dut.a = request ? request->a : random_bits();
#if OPERANDS > 1
    dut.b = request ? request->b : random_bits();
#endif
#if OPERANDS > 2
    dut.c = request ? request->c : random_bits();
#endif
    dut.eval();
    if (request) {
        due[due_head++ % 64] = {cycle + LATENCY - 1, response};
    }
    bool expected = due_tail != due_head && due[due_tail % 64].at == cycle;
    if (bool(dut.out_valid) != expected) {
        fprintf(stderr, "cycle %llu: out_valid is %d, expected %d\n", (unsigned long long)cycle, dut.out_valid, expected);
        exit(1);
    }
    if (expected) {
        *due[due_tail++ % 64].response = {dut.result, dut.flags};
    }
    dut.clk = 1;
    dut.eval();
    cycle++;
}

int main(int argc, char **argv) {
    // A planted fault is chosen by `+fault=`.
    Verilated::commandArgs(argc, argv);
    // A unit has no reset: LATENCY cycles without an operation leave no trace of what was before.
    for (int i = 0; i < LATENCY + INTERVAL; i++) {
        dut.clk = 0;
        dut.in_valid = 0;
        dut.eval();
        dut.clk = 1;
        dut.eval();
    }
    uint32_t count;
    std::vector<Request> requests;
    std::vector<Response> responses;
    while (fread(&count, sizeof count, 1, stdin) == 1) {
        requests.resize(count);
        responses.resize(count);
        if (fread(requests.data(), sizeof(Request), count, stdin) != count) {
            fprintf(stderr, "a batch is cut short\n");
            return 1;
        }
        for (uint32_t i = 0; i < count; i++) {
            for (uint32_t j = 0; j < requests[i].idle; j++) {
                step(nullptr, nullptr);
            }
            step(&requests[i], &responses[i]);
            for (int j = 1; j < INTERVAL; j++) {
                step(nullptr, nullptr);
            }
        }
        for (int j = 0; j < LATENCY; j++) {
            step(nullptr, nullptr);
        }
        fwrite(responses.data(), sizeof(Response), count, stdout);
        fflush(stdout);
    }
    return 0;
}
