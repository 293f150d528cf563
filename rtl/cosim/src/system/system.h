// Driver of a system of cores. The generated part before it defines PINS, set_pin, pin, clear_strobes and observe.

static void look(bool watch) {
    if (watch) observe();
}

static void reset() {
    cycle = INT64_MIN / 2;
    for (unsigned i = 0; i < PINS; i++) set_pin(i, 0);
    clear_strobes();
    top->rst = 1;
    for (unsigned i = 0; i < 4; i++) pass(false);
    top->rst = 0;
    settle();
    while (!top->running) {
        pass(false);
        settle();
    }
    cycle = 0;
}

// A system loads itself from its image, once.
static void load() {
    fprintf(stderr, "a system is not loaded\n");
    exit(1);
}
