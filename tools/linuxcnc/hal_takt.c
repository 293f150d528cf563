// SPDX-License-Identifier: MIT OR Apache-2.0
// hal_takt: LinuxCNC's servo thread as the planner of the hybrid robot, whose controller runs on a board (docs/linuxcnc.md).
//
// takt.write sends a knot each servo period, the joints' commanded positions with their velocities; a core of the board interpolates
// between knots at 10 kHz (programs/hybrid/interpolation.s). The board sends a frame each millisecond with what its encoders had and the
// point that belongs to it. takt.read takes it, and waits for it while the board has QUEUE knots: the board's clock paces the thread, so
// that a simulated board may take any time. The order in the thread: takt.read, motion, takt.write.
//
// A fault ends in safe outputs and `takt.fault`, which stays until `takt.enable` has gone to 0.

#include <math.h>
#include <stdio.h>

#include "rtapi.h"
#include "rtapi_app.h"
#include "hal.h"
#include "takt_link.h"

MODULE_DESCRIPTION("the hybrid robot's controller on a board of Takt");
MODULE_AUTHOR("The Takt authors");
MODULE_LICENSE("Dual MIT/GPL");

static char *port = "/dev/ttyUSB0";
RTAPI_MP_STRING(port, "serial port of the board, or the pseudo-terminal of `takt board sim`");
static int baud = 3000000;
RTAPI_MP_INT(baud, "bits per second, as in the wiring");
static int timeout = 25;
RTAPI_MP_INT(timeout, "ms without an answer or a frame that are a fault; of a simulated board, more");

// programs/hybrid/followed.toml and interpolation.s.
enum {
    AXES = 5, CORES = 2,
    BEGIN = 3,             // knots that wait on the board before it begins
    QUEUE = BEGIN + 1,     // knots that are there in the long run
    EVERY = 10,            // periods from knot to knot, and from frame to frame
    HISTORY = 32,          // knots that are remembered, to know the point of a frame
    STATUS_EVERY = 10,     // servo periods from one look at the board's status to the next
    OFF_EVERY = 10,        // servo periods from one look at the encoders of a stopped board to the next
    PROBE_EVERY = 500,     // servo periods from one attempt to reach a silent board to the next
};
// Addresses of followed.toml (checked by tools/cli/tests/linuxcnc.rs): the encoders, which the host could also drive; the snapshot
// `measured`, behind the wires to the motors; the FIFO's first field.
enum { N1 = TAKT_DRIVEN, MEASURED = TAKT_SEEN + AXES, TO_1 = TAKT_FIFOS + 1 };
// Words of a frame: `periods`, then the snapshot.
enum { M1 = 1, KNOT = 6, PHASE, STARVED, STANDING, FRAME_WORDS };
static const double STEP = 1e-3;                           // s, from knot to knot
static const double UNIT[2] = {1.0 / (1 << 30), 1.0 / (1 << 26)}; // m and rad, of a knot's integers
static const double LARGEST = 1 << 30;                     // of these: the difference of two must fit

// docs/robot.md: the radius of the arms' pivots, and what a count is.
static const double R = 0.5, COUNT[2] = {0.25e-6, 2 * M_PI / 262144};

enum state { OFF, RUNNING, FAULTED };
enum fault { NONE, LINK, STARVING, STOPPED, FOLLOWING, REFUSED, RANGE };
static const char *const FAULTS[] = {
    "", "the board does not answer", "the board has run out of knots", "the board has stopped its outputs",
    "a joint does not follow", "the board refuses a request", "a position is out of range",
};
static const char *const CAUSES[] = {"fault", "halt", "missed deadline", "host silent", "stop", "NaN output"};

typedef struct {
    hal_bit_t *enable, *driving, *fault;
    hal_u32_t *code, *causes, *period, *frame_knot, *phase, *knot, *starved, *skipped, *misses, *cycles;
    hal_float_t *position[AXES], *velocity[AXES], *feedback[AXES], *error[AXES];
    hal_float_t limit[AXES];
} pins;

static pins *hal;
static int component;
static takt_link board;
static enum state state;
static uint32_t sent, last_period;
static int since_status, since_probe, is_silent, is_asked;
static int64_t asked;                                      // when the encoders were asked for, ms
static double knots[HISTORY][2][AXES];                     // positions and velocities, m and rad

static int rotary(int axis) { return axis >= 3; }

// LinuxCNC's units, mm and degrees, in SI units.
static double si(int axis) { return rotary(axis) ? M_PI / 180 : 1e-3; }

// Tool and table of encoder counts, (14) and (15) of docs/robot.md.
static void pose_of(const uint32_t *counts, double *pose) {
    double l[3];
    for (int i = 0; i < 3; i++) l[i] = (int32_t)counts[i] * COUNT[0];
    double a = l[0] * l[0], b = l[1] * l[1], c = l[2] * l[2];
    double x = -sqrt(3) * (b - c) / (6 * R), y = -(2 * a - b - c) / (6 * R);
    pose[0] = x;
    pose[1] = y;
    pose[2] = sqrt(fmax(a - x * x - (y - R) * (y - R), 0));
    for (int i = 3; i < AXES; i++) pose[i] = (int32_t)counts[i] * COUNT[1];
}

static void show(const uint32_t *counts, double *pose) {
    pose_of(counts, pose);
    for (int i = 0; i < AXES; i++) *hal->feedback[i] = pose[i] / si(i);
}

// A request, with an answer that is waited for. Silence is a fault only where the outputs should drive.
static int request(uint16_t address, int count, const uint32_t *words) {
    return takt_do(&board, address, count, words, timeout);
}

static int control(uint32_t word) {
    return request(TAKT_CONTROL, 1, &word);
}

static void fail(enum fault fault, const char *detail) {
    uint32_t none = 0;
    // Whatever the fault is, the board is told; if that fails, it makes its outputs safe by itself.
    int told = fault == LINK ? takt_do(&board, TAKT_CONTROL, 1, &none, timeout / TAKT_ATTEMPTS) : control(0);
    state = FAULTED;
    *hal->driving = 0;
    *hal->fault = 1;
    *hal->code = fault;
    is_silent = told < 0;
    since_probe = 0;
    rtapi_print_msg(RTAPI_MSG_ERR, "takt: %s: %s%s\n", FAULTS[fault], detail,
        told < 0 ? "; outputs are safe once the board has missed its host for as long as its wiring says" : "; outputs are safe");
}

static void fail_silent(void) {
    char text[160];
    snprintf(text, sizeof text, "nothing for %d ms at %s: is the cable plugged in, and the board powered?", timeout, port);
    fail(LINK, text);
}

// A fault that the board has, by its status.
static void fail_stopped(uint32_t status) {
    char text[160] = "";
    for (unsigned i = 0; i < sizeof CAUSES / sizeof *CAUSES; i++)
        if (status >> (TAKT_CAUSES + i) & 1) {
            size_t used = strlen(text);
            snprintf(text + used, sizeof text - used, "%s%s", used ? ", " : "", CAUSES[i]);
        }
    fail(STOPPED, *text ? text : "it was started again, or reset");
}

static int look_at_status(void) {
    // Registers from `status` to `most_cycles` with one request: on a serial line every one takes a millisecond.
    int done = request(TAKT_STATUS, TAKT_MOST_CYCLES - TAKT_STATUS + 1, NULL);
    if (done) {
        if (done < 0) fail_silent();
        else fail(REFUSED, "the register `status`");
        return -1;
    }
    uint32_t status = board.words[0];
    *hal->misses = board.words[TAKT_MISSES - TAKT_STATUS];
    *hal->cycles = board.words[TAKT_MOST_CYCLES - TAKT_STATUS];
    *hal->causes = status >> TAKT_CAUSES & 0x3f;
    *hal->driving = (status & TAKT_DRIVE) != 0;
    return 0;
}

// A knot of the joints' commanded positions; with velocity 0 if it is where the robot stands.
static int push(int stands) {
    uint32_t words[2 * AXES + 1];
    double(*knot)[AXES] = knots[(sent + 1) % HISTORY];
    for (int i = 0; i < AXES; i++) {
        knot[0][i] = *hal->position[i] * si(i);
        knot[1][i] = stands ? 0 : *hal->velocity[i] * si(i);
        double units = nearbyint(knot[0][i] / UNIT[rotary(i)]);
        if (!(fabs(units) < LARGEST) || !isfinite(knot[1][i])) {
            char text[80];
            snprintf(text, sizeof text, "joint %d at %g, of +-%g", i, *hal->position[i], LARGEST * UNIT[rotary(i)] / si(i));
            fail(RANGE, text);
            return -1;
        }
        float speed = (float)knot[1][i];
        words[i] = (uint32_t)(int32_t)units;
        memcpy(&words[AXES + i], &speed, sizeof speed);
    }
    words[2 * AXES] = 0;
    *hal->knot = ++sent;
    if (takt_request(&board, TO_1, 2 * AXES + 1, words)) {
        fail_silent();
        return -1;
    }
    return 0;
}

static void start(void) {
    uint32_t stream = (uint32_t)EVERY << 20 | (FRAME_WORDS - 1) << 16 | MEASURED;
    sent = last_period = 0;
    since_status = 0;
    *hal->code = *hal->causes = 0;
    *hal->frame_knot = *hal->phase = *hal->starved = *hal->skipped = *hal->period = 0;
    state = RUNNING;
    // Stopped first, so that it begins anew; frames that were still on the line are those of before.
    int silent = is_asked && takt_answer(&board, timeout);
    is_asked = 0;
    silent = silent || control(0);
    board.streamed = 0;
    // The core waits for the first knot before its first period. The stream is there from then on: a simulated board waits after each of its
    // frames, and would otherwise be far ahead by now.
    silent = silent || request(TAKT_STREAM, 1, &stream) || control(TAKT_RUN | TAKT_ENABLE) || push(1) || takt_answer(&board, timeout);
    if (silent && state == RUNNING) fail_silent();
}

// What a frame says.
static void take_frame(void) {
    const uint32_t *words = board.stream.words;
    double pose[AXES];
    if (board.stream.count != FRAME_WORDS) return;
    show(words + M1, pose);
    if (last_period && words[0] - last_period != EVERY) *hal->skipped += (words[0] - last_period) / EVERY - 1;
    last_period = *hal->period = words[0];
    *hal->frame_knot = words[KNOT];
    *hal->phase = words[PHASE];
    *hal->starved = words[STARVED];
    if (words[STARVED]) {
        fail(STARVING, "LinuxCNC's servo thread was late by more than the knots that wait there");
        return;
    }
    // The point that belongs to the encoders: on the cubic that ends with the last knot that was taken.
    uint32_t end = words[KNOT], begin = end > 1 && !words[STANDING] ? end - 1 : end;
    if (sent - begin >= HISTORY) return;
    double s = words[STANDING] ? 0 : words[PHASE] * (1.0 / EVERY);
    for (int i = 0; i < AXES; i++) {
        double(*p)[AXES] = knots[begin % HISTORY], (*q)[AXES] = knots[end % HISTORY];
        double d = q[0][i] - p[0][i], u = p[1][i] * STEP, w = q[1][i] * STEP;
        double point = p[0][i] + s * (u + s * (3 * d - 2 * u - w + s * (u + w - 2 * d)));
        *hal->error[i] = (pose[i] - point) / si(i);
        if (hal->limit[i] > 0 && fabs(*hal->error[i]) > hal->limit[i]) {
            char text[96];
            // Perhaps the board has stopped its outputs, which the next look at its status would tell.
            if (look_at_status()) return;
            if (!*hal->driving) return fail_stopped(*hal->causes << TAKT_CAUSES);
            snprintf(text, sizeof text, "joint %d is off by %g, more than %g", i, *hal->error[i], hal->limit[i]);
            fail(FOLLOWING, text);
            return;
        }
    }
}

// Of a board that is stopped, or silent: it is asked again and again, without being waited for.
static void read_off(void) {
    double pose[AXES];
    takt_hear(&board, 0);
    if (is_asked && board.answered && board.count == AXES) {
        is_asked = is_silent = 0;
        show(board.words, pose);
    }
    if (is_asked && takt_now_ms() - asked > timeout) {
        is_asked = 0;
        is_silent = 1;
    }
    if (is_asked || ++since_probe < (is_silent ? PROBE_EVERY : OFF_EVERY)) return;
    since_probe = 0;
    is_asked = 1;
    asked = takt_now_ms();
    takt_request(&board, N1, AXES, NULL);
}

static void takt_read(void *unused, long period) {
    (void)unused;
    if (state != RUNNING) {
        read_off();
        return;
    }
    // A knot whose answer has not come is made again.
    int done = takt_answer(&board, timeout);
    if (done < 0) return fail_silent();
    if (done) return fail(REFUSED, "a knot");
    int64_t until = takt_now_ms() + timeout;
    while (takt_hear(&board, 0) > 0) continue;
    while (sent - *hal->frame_knot >= QUEUE || board.streamed) {
        if (board.streamed) {
            board.streamed = 0;
            take_frame();
            if (state != RUNNING) return;
            continue;
        }
        int64_t now = takt_now_ms();
        int gone = now >= until ? -1 : takt_hear(&board, (int)(until - now));
        if (gone < 0) {
            // No frame comes of a board that has stopped; perhaps it answers.
            if (look_at_status()) return;
            if (*hal->driving) return fail(LINK, "its stream has ended");
            return fail_stopped(*hal->causes << TAKT_CAUSES);
        }
    }
#ifdef RTAPI_TASK_PLL_SUPPORT
    // A thread whose clock is slower than the board's would let the queue run empty: it is made to come a little earlier.
    rtapi_task_pll_set_correction(sent - *hal->frame_knot < QUEUE - 1 ? -period / 100 : 0);
#else
    (void)period;
#endif
}

static void takt_write(void *unused, long period) {
    (void)unused;
    (void)period;
    if (!*hal->enable) {
        if (state == RUNNING) control(0);
        *hal->fault = *hal->driving = 0; // The code stays, for whoever looks for the cause.
        state = OFF;
        return;
    }
    if (state == OFF) {
        if (is_silent) return fail_silent();
        return start();
    }
    if (state != RUNNING || push(0)) return;
    if (++since_status < STATUS_EVERY) return;
    since_status = 0;
    int done = takt_answer(&board, timeout);
    if (done < 0) return fail_silent();
    if (done) return fail(REFUSED, "a knot");
    if (look_at_status()) return;
    // Before the end of its first period it does not drive yet.
    if (!*hal->driving && *hal->period > 0) return fail_stopped(*hal->causes << TAKT_CAUSES);
}

static int export(void) {
    int bad = 0;
    bad |= hal_pin_bit_newf(HAL_IN, &hal->enable, component, "takt.enable");
    bad |= hal_pin_bit_newf(HAL_OUT, &hal->driving, component, "takt.driving");
    bad |= hal_pin_bit_newf(HAL_OUT, &hal->fault, component, "takt.fault");
    struct { hal_u32_t **pin; const char *name; } counts[] = {
        {&hal->code, "fault-code"}, {&hal->causes, "causes"}, {&hal->period, "period"}, {&hal->frame_knot, "frame-knot"},
        {&hal->phase, "phase"}, {&hal->knot, "knot"}, {&hal->starved, "starved"}, {&hal->skipped, "skipped"},
        {&hal->misses, "misses"}, {&hal->cycles, "most-cycles"},
    };
    for (unsigned i = 0; i < sizeof counts / sizeof *counts; i++)
        bad |= hal_pin_u32_newf(HAL_OUT, counts[i].pin, component, "takt.%s", counts[i].name);
    for (int i = 0; i < AXES; i++) {
        bad |= hal_pin_float_newf(HAL_IN, &hal->position[i], component, "takt.%d.pos-cmd", i);
        bad |= hal_pin_float_newf(HAL_IN, &hal->velocity[i], component, "takt.%d.vel-cmd", i);
        bad |= hal_pin_float_newf(HAL_OUT, &hal->feedback[i], component, "takt.%d.pos-fb", i);
        bad |= hal_pin_float_newf(HAL_OUT, &hal->error[i], component, "takt.%d.error", i);
        bad |= hal_param_float_newf(HAL_RW, &hal->limit[i], component, "takt.%d.error-limit", i);
    }
    bad |= hal_export_funct("takt.read", takt_read, NULL, 1, 0, component);
    bad |= hal_export_funct("takt.write", takt_write, NULL, 1, 0, component);
    return bad;
}

// Says who is there.
static int meet(void) {
    int error = takt_open(&board, port, baud);
    if (error) {
        rtapi_print_msg(RTAPI_MSG_ERR, "takt: cannot open %s at %d baud: %s\n", port, baud,
            error == EINVAL ? "no serial port, or no rate that is known (115200 to 4000000)" : strerror(error));
        return -error;
    }
    int done = request(TAKT_ID, 1, NULL);
    uint32_t id = board.words[0];
    const char *wrong = done < 0 ? "nothing answers: is this the right port, with the wiring's baud rate, and the board's bitstream loaded?"
        : done || id >> 16 != TAKT_MAGIC ? "what answers is no board of Takt"
        : (id >> 8 & 0xff) != TAKT_VERSION ? "the board speaks another version of the protocol"
        : (id & 0xff) != CORES ? "the board does not carry programs/hybrid/followed.toml"
        : control(0) || request(N1, AXES, NULL) ? "the board does not let its encoders be read" : NULL;
    if (wrong) {
        rtapi_print_msg(RTAPI_MSG_ERR, "takt: %s: %s\n", port, wrong);
        close(board.fd);
        return -ENODEV;
    }
    return 0;
}

int rtapi_app_main(void) {
    double pose[AXES];
    int error = meet();
    if (error) return error;
    component = hal_init("hal_takt");
    if (component < 0) return component;
    hal = hal_malloc(sizeof *hal);
    if (!hal || export()) {
        hal_exit(component);
        return -ENOMEM;
    }
    show(board.words, pose);
    hal_ready(component);
    return 0;
}

void rtapi_app_exit(void) {
    control(0);
    close(board.fd);
    hal_exit(component);
}
