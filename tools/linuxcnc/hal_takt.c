// SPDX-License-Identifier: MIT OR Apache-2.0
// hal_takt: LinuxCNC's servo thread as the planner of a machine whose controller runs on a board (docs/linuxcnc.md). Joints, units and the
// board's addresses are parameters, which `takt board hal` writes; without them, those of the hybrid robot.
//
// takt.write sends a knot each servo period, the joints' commanded positions with their velocities; a core of the board interpolates
// between knots in each of its periods (programs/hybrid/interpolation.s). The board sends a frame each servo period with what its encoders
// had and the point that belongs to it. takt.read takes it, and waits for it while the board has QUEUE knots: the board's clock paces the thread, so
// that a simulated board may take any time. The order in the thread: takt.read, motion, takt.write.
//
// A fault ends in safe outputs and `takt.fault`, which stays until `takt.enable` has gone to 0.

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "rtapi.h"
#include "rtapi_app.h"
#include "hal.h"
#include "takt_link.h"

MODULE_DESCRIPTION("a machine's controller on a board of Takt");
MODULE_AUTHOR("The Takt authors");
MODULE_LICENSE("Dual MIT/GPL");

static char *port = "/dev/ttyUSB0";
RTAPI_MP_STRING(port, "serial port of the board, or the pseudo-terminal of `takt board sim`");
static int baud = 3000000;
RTAPI_MP_INT(baud, "bits per second, as in the wiring");
static int timeout = 25;
RTAPI_MP_INT(timeout, "ms without an answer or a frame that are a fault; of a simulated board, more");

// As `takt board hal` writes them; here those of programs/hybrid/followed.toml.
static char *joints = "LLLRR";
RTAPI_MP_STRING(joints, "a letter for each joint: L linear (mm), R rotary (degrees)");
static char *counts = "2.5e-7:2.5e-7:2.5e-7:2.3968449810713143e-5:2.3968449810713143e-5";
RTAPI_MP_STRING(counts, "m or rad of an encoder's count, for each joint, between colons");
static char *geometry = "hybrid";
RTAPI_MP_STRING(geometry, "joints from encoders: `direct`, each from its own; `hybrid`, docs/robot.md");
static int cores = 2;
RTAPI_MP_INT(cores, "cores of the system that the board carries");
static int encoders = 0x3000;
RTAPI_MP_INT(encoders, "address of the first encoder's count, which the others follow");
static int measured = 0x3405;
RTAPI_MP_INT(measured, "address of the snapshot: counts, knot, phase, starved, standing");
static int fifo = 0x3801;
RTAPI_MP_INT(fifo, "address of the first field of the FIFO of knots: positions, then velocities");
static int every = 10;
RTAPI_MP_INT(every, "periods of the board from knot to knot, and from frame to frame");
static int servo = 1000;
RTAPI_MP_INT(servo, "us from knot to knot: the period of the servo thread");

enum {
    MOST = 7,              // joints: a knot is one request
    BEGIN = 3,             // knots that wait on the board before it begins
    QUEUE = BEGIN + 1,     // knots that are there in the long run
    HISTORY = 32,          // knots that are remembered, to know the point of a frame
    STATUS_EVERY = 10,     // servo periods from one look at the board's status to the next
    OFF_EVERY = 10,        // servo periods from one look at the encoders of a stopped board to the next
    PROBE_EVERY = 500,     // servo periods from one attempt to reach a silent board to the next
};
// Words of a frame: `periods`, the counts, and behind them these.
enum { M1 = 1, KNOT = 0, PHASE, STARVED, STANDING, BEHIND };
static const double UNIT[2] = {1.0 / (1 << 30), 1.0 / (1 << 26)}; // m and rad, of a knot's integers
static const double LARGEST = 1 << 30;                     // of these: the difference of two must fit

// docs/robot.md: the radius of the arms' pivots.
static const double R = 0.5;

enum state { OFF, RUNNING, FAULTED };
enum fault { NONE, LINK, STARVING, STOPPED, FOLLOWING, REFUSED, RANGE };
static const char *const FAULTS[] = {
    "", "the board does not answer", "the board has run out of knots", "the board has stopped its outputs",
    "a joint does not follow", "the board refuses a request", "a position is out of range",
};
static const char *const CAUSES[] = {"fault", "halt", "missed deadline", "host silent", "stop", "NaN output",
                                      "trip", "cores differ"};

typedef struct {
    hal_bit_t *enable, *driving, *fault;
    hal_u32_t *code, *causes, *period, *frame_knot, *phase, *knot, *starved, *skipped, *misses, *cycles;
    hal_float_t *position[MOST], *velocity[MOST], *feedback[MOST], *error[MOST];
    hal_float_t limit[MOST];
} pins;

static pins *hal;
static int component;
static takt_link board;
static enum state state;
static uint32_t sent, last_period;
static int since_status, since_probe, is_silent, is_asked;
static int64_t asked;                                      // when the encoders were asked for, ms
static double knots[HISTORY][2][MOST];                     // positions and velocities, m and rad
static int axes;                                           // joints
static double count[MOST];                                 // m or rad of an encoder's count
static void (*pose_of)(const uint32_t *counts, double *pose);

static int rotary(int axis) { return joints[axis] == 'R'; }

// LinuxCNC's units, mm and degrees, in SI units.
static double si(int axis) { return rotary(axis) ? M_PI / 180 : 1e-3; }

// Each joint from its own encoder.
static void direct(const uint32_t *counts, double *pose) {
    for (int i = 0; i < axes; i++) pose[i] = (int32_t)counts[i] * count[i];
}

// The hybrid robot's tool from its three arms, (14) and (15) of docs/robot.md.
static void hybrid(const uint32_t *counts, double *pose) {
    direct(counts, pose);
    double a = pose[0] * pose[0], b = pose[1] * pose[1], c = pose[2] * pose[2];
    double x = -sqrt(3) * (b - c) / (6 * R), y = -(2 * a - b - c) / (6 * R);
    pose[0] = x;
    pose[1] = y;
    pose[2] = sqrt(fmax(a - x * x - (y - R) * (y - R), 0));
}

// Joints, units and geometry of the parameters; what is wrong with them.
static const char *configure(void) {
    axes = (int)strlen(joints);
    if (axes < 1 || axes > MOST || strspn(joints, "LR") != (size_t)axes) return "`joints` has 1 to 7 letters, L or R";
    char *next = counts;
    for (int i = 0; i < axes; i++) {
        char *end;
        count[i] = strtod(next, &end);
        if (end == next || !isfinite(count[i]) || count[i] == 0 || *end != (i + 1 < axes ? ':' : 0))
            return "`counts` has a number for each joint, with colons between them";
        next = end + 1;
    }
    if (every < 1 || every > 4095 || servo < 1) return "`every` is 1 to 4095 periods, `servo` us";
    int is_hybrid = strcmp(geometry, "hybrid") == 0;
    if (!is_hybrid && strcmp(geometry, "direct") != 0) return "`geometry` is `direct` or `hybrid`";
    if (is_hybrid && (axes < 3 || strncmp(joints, "LLL", 3) != 0)) return "the geometry `hybrid` has joints LLL, and others behind them";
    pose_of = is_hybrid ? hybrid : direct;
    return NULL;
}

static void show(const uint32_t *counts, double *pose) {
    pose_of(counts, pose);
    for (int i = 0; i < axes; i++) *hal->feedback[i] = pose[i] / si(i);
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
    *hal->causes = status >> TAKT_CAUSES & 0xff;
    *hal->driving = (status & TAKT_DRIVE) != 0;
    return 0;
}

// A knot of the joints' commanded positions; with velocity 0 if it is where the robot stands.
static int push(int stands) {
    uint32_t words[2 * MOST + 1];
    double(*knot)[MOST] = knots[(sent + 1) % HISTORY];
    for (int i = 0; i < axes; i++) {
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
        memcpy(&words[axes + i], &speed, sizeof speed);
    }
    words[2 * axes] = 0;
    *hal->knot = ++sent;
    if (takt_request(&board, (uint16_t)fifo, 2 * axes + 1, words)) {
        fail_silent();
        return -1;
    }
    return 0;
}

static void start(void) {
    uint32_t stream = (uint32_t)every << 20 | (uint32_t)(axes + BEHIND) << 16 | (uint32_t)measured;
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
    const uint32_t *words = board.stream.words, *behind = words + M1 + axes;
    double pose[MOST];
    if (board.stream.count != M1 + axes + BEHIND) return;
    show(words + M1, pose);
    if (last_period && words[0] - last_period != (uint32_t)every) *hal->skipped += (words[0] - last_period) / (uint32_t)every - 1;
    last_period = *hal->period = words[0];
    *hal->frame_knot = behind[KNOT];
    *hal->phase = behind[PHASE];
    *hal->starved = behind[STARVED];
    if (behind[STARVED]) {
        fail(STARVING, "LinuxCNC's servo thread was late by more than the knots that wait there");
        return;
    }
    // The point that belongs to the encoders: on the cubic that ends with the last knot that was taken.
    uint32_t end = behind[KNOT], begin = end > 1 && !behind[STANDING] ? end - 1 : end;
    if (sent - begin >= HISTORY) return;
    double s = behind[STANDING] ? 0 : behind[PHASE] * (1.0 / every);
    for (int i = 0; i < axes; i++) {
        double(*p)[MOST] = knots[begin % HISTORY], (*q)[MOST] = knots[end % HISTORY];
        double d = q[0][i] - p[0][i], u = p[1][i] * servo * 1e-6, w = q[1][i] * servo * 1e-6;
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
    double pose[MOST];
    takt_hear(&board, 0);
    if (is_asked && board.answered && board.count == axes) {
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
    takt_request(&board, (uint16_t)encoders, axes, NULL);
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
    for (int i = 0; i < axes; i++) {
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

// Connects to the board, and checks that it carries the system with the axes of this component.
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
        : done || id >> 16 != TAKT_MAGIC ? "the device that answers is not a board of Takt"
        : (id >> 8 & 0xff) != TAKT_VERSION ? "the board speaks another version of the protocol"
        : (id & 0xff) != (uint32_t)cores ? "the board carries another system: its number of cores is not `cores`"
        : control(0) || request((uint16_t)encoders, axes, NULL) ? "the board does not let its encoders be read" : NULL;
    if (wrong) {
        rtapi_print_msg(RTAPI_MSG_ERR, "takt: %s: %s\n", port, wrong);
        close(board.fd);
        return -ENODEV;
    }
    return 0;
}

int rtapi_app_main(void) {
    double pose[MOST];
    const char *wrong = configure();
    if (wrong) {
        rtapi_print_msg(RTAPI_MSG_ERR, "takt: %s\n", wrong);
        return -EINVAL;
    }
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
