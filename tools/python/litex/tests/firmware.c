/* Loads the program into each Takt of the SoC, runs its periods, and prints every output as `<takt> <period> <output> <bits>`.
 * periods.h: inputs and ports, from tools/evidence/src/litex.rs. */

#include <generated/csr.h>
#include <generated/mem.h>
#include <irq.h>

#include "periods.h"
#include "tracking.h"

/* Ends the simulation. */
#define END 4

static volatile uint32_t interrupts[2];
static volatile uint32_t traps;

static void put(char c)
{
    while (uart_txfull_read()) {
    }
    uart_rxtx_write(c);
}

static void text(const char *s)
{
    while (*s) put(*s++);
}

static void number(uint32_t value)
{
    for (int shift = 28; shift >= 0; shift -= 4) put("0123456789abcdef"[value >> shift & 15]);
}

static void named(const char *name, uint32_t value)
{
    text(name);
    number(value);
    put('\n');
}

void isr(void)
{
    uint32_t cause = csrr(mcause);
    if (!(cause & 0x80000000u)) {
        /* A bus error: on with the next instruction. */
        traps++;
        csrw(mepc, csrr(mepc) + 4);
        return;
    }
    if (irq_pending() & 1u << TAKT_INTERRUPT) {
        interrupts[0]++;
        takt_ev_pending_write(1);
    }
    if (irq_pending() & 1u << TAKT_AXI_INTERRUPT) {
        interrupts[1]++;
        takt_axi_ev_pending_write(1);
    }
}

/* The interrupt comes with the rise of `waiting`. */
static int waits(int which, uint32_t before)
{
    for (uint32_t i = 0; i < 100000; i++)
        if (interrupts[which] != before) return 1;
    return 0;
}

static void run(int which, volatile uint32_t *bus)
{
    uint32_t before = interrupts[which];
    tracking_load(bus);
    bus[TRACKING_PERIOD] = 0;
    bus[TRACKING_CONTROL] = TRACKING_CONTROL_RUN_MASK;
    if (!waits(which, before)) named("no wait after the start ", bus[TRACKING_STATUS]);
    for (uint32_t period = 0; period < PERIODS; period++) {
        for (uint32_t i = 0; i < INPUTS; i++) bus[input_ports[i]] = inputs[period][i];
        before = interrupts[which];
        bus[TRACKING_TICK] = 1;
        if (!waits(which, before)) named("no wait ", bus[TRACKING_STATUS]);
        for (uint32_t i = 0; i < OUTPUTS; i++) {
            number(which);
            put(' ');
            number(period);
            put(' ');
            number(i);
            put(' ');
            number(bus[output_ports[i]]);
            put('\n');
        }
    }
    named("interrupts ", interrupts[which]);
    /* A byte written changes nothing. */
    bus[TRACKING_PERIOD] = 0x12345678;
    ((volatile uint8_t *)(bus + TRACKING_PERIOD))[1] = 0;
    named("word ", bus[TRACKING_PERIOD]);
    bus[TRACKING_CONTROL] = 0;
}

int main(void)
{
    irq_setmask(1u << TAKT_INTERRUPT | 1u << TAKT_AXI_INTERRUPT);
    irq_setie(1);
    takt_ev_enable_write(1);
    takt_axi_ev_enable_write(1);
    run(0, (volatile uint32_t *)TAKT_BASE);
    run(1, (volatile uint32_t *)TAKT_AXI_BASE);
    named("traps ", traps);
    put(END);
    for (;;) {
    }
}
