// Driver of a core by itself. The generated part before it defines SLOTS, RESET_CYCLES, OUTPUTS, LATCHED, REGISTERS and the output ports
// by slot, PAIR for a pair, and ECC for error correction.
//
//   3 load   count, then that many (space, slot, address, low, high); space 3 is an input port. Resets, then loads

// Spaces of the loader, as in `takt_isa::load::Space`; 3 is an input port.
enum Space { TO_PROGRAM, TO_DATA, TO_REGISTER, TO_INPUT };

static Was was;
// For each output port: written since the last publication; written at all before it; value shown at that time.
static bool written[OUTPUTS], known[OUTPUTS];
static uint32_t shown[OUTPUTS];

// Known contents of a memory: equal words are not loaded again. Most words of random programs are equal, and loading both
// memories completely takes several times as long as the program.
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

// After a `publish` or a `wait`, all written values are visible outside; with latched ports, outputs change at no other time.
static void observe_outputs() {
    if (top->published) {
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

static void look(bool watch) {
    if (watch) observe();
#ifdef PAIR
    if (watch && top->differs) {
        fprintf(stderr, "the cores of the pair differ in cycle %lld\n", (long long)cycle);
        exit(1);
    }
#endif
#ifdef ECC
    if (watch && (top->upset || top->corrections)) {
        fprintf(stderr, "a word of a memory is wrong in cycle %lld\n", (long long)cycle);
        exit(1);
    }
#endif
    // The memory's write port shows every write, one cycle before the memory holds it.
    if (top->stored) data_memory.set(top->stored_address, top->stored_value);
}

// ---- pins: as `Pin` in lockstep.rs

static const unsigned PINS = 0;
enum { TICK, INPUT_WRITE, INPUT_INDEX, INPUT_VALUE };

static void set_pin(uint32_t pin, uint32_t value) {
    switch (pin) {
    case TICK: top->tick = value; break;
    case INPUT_WRITE: top->input_write = value; break;
    case INPUT_INDEX: top->input_index = value; break;
    case INPUT_VALUE: top->input_value = value; break;
    }
}

static uint32_t pin(uint32_t) {
    return 0;
}

static void clear_strobes() {
    top->tick = 0;
    top->input_write = 0;
}

// A core starts only when a program is loaded. The cores of a pair begin with the same words in their banks, as block RAM does: wild
// programs read registers that nothing has written.
static void reset() {
    top->clk = 0;
#ifdef PAIR
    top->rst = 1;
    for (unsigned i = 0; i < RESET_CYCLES; i++) pass(false);
    top->load = top->input_write = 1;
    top->load_space = TO_REGISTER;
    top->load_value = 0;
    top->input_value = 0;
    for (unsigned i = 0; i < REGISTERS; i++) {
        top->load_address = i;
        top->input_index = i;
        pass(false);
    }
    top->load = top->input_write = 0;
#endif
}

static void load() {
    top->rst = 1;
    top->load = 0;
    clear_strobes();
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
