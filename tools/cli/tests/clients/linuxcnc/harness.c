// SPDX-License-Identifier: MIT OR Apache-2.0
// Runs LinuxCNC's component without LinuxCNC: moves the robot's first axis a distance, and prints the component's pins at the end.
//
//   harness PORT BAUD TIMEOUT [PARAMETER=VALUE]...

#include <stdarg.h>
#include <stdlib.h>

#include "../../../../linuxcnc/hal_takt.c"

void rtapi_print_msg(int level, const char *format, ...) {
    va_list arguments;
    (void)level;
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
}

int hal_init(const char *name) { (void)name; return 1; }
int hal_exit(int id) { (void)id; return 0; }
int hal_ready(int id) { (void)id; return 0; }
void *hal_malloc(long size) { return calloc(1, (size_t)size); }
int hal_export_funct(const char *name, hal_function function, void *argument, int is_float, int is_reentrant, int id) {
    (void)name, (void)function, (void)argument, (void)is_float, (void)is_reentrant, (void)id;
    return 0;
}
// Pins are accessed through the component's own pointers.
#define PIN(kind) \
    int hal_pin_##kind##_newf(int way, hal_##kind##_t **pin, int id, const char *format, ...) { \
        (void)way, (void)id, (void)format; \
        return !(*pin = calloc(1, sizeof **pin)); \
    }
PIN(bit)
PIN(u32)
PIN(float)
int hal_param_float_newf(int way, hal_float_t *pin, int id, const char *format, ...) {
    (void)way, (void)pin, (void)id, (void)format;
    return 0;
}

// A parameter, as `loadrt` gives it.
static void set(char *text) {
    struct { const char *name; char **string; int *number; } all[] = {
        {"joints", &joints, NULL}, {"counts", &counts, NULL}, {"geometry", &geometry, NULL}, {"cores", NULL, &cores},
        {"encoders", NULL, &encoders}, {"measured", NULL, &measured}, {"fifo", NULL, &fifo}, {"every", NULL, &every},
        {"servo", NULL, &servo},
    };
    char *value = strchr(text, '=');
    if (!value) exit(2);
    *value++ = 0;
    for (unsigned i = 0; i < sizeof all / sizeof *all; i++)
        if (strcmp(all[i].name, text) == 0) {
            if (all[i].string) *all[i].string = value;
            else *all[i].number = (int)strtol(value, NULL, 0);
            return;
        }
    fprintf(stderr, "no parameter %s\n", text);
    exit(2);
}

// Distance in mm, and duration in ms.
static const double WAY = 5;
enum { MOVE = 200, STAY = 20 };

int main(int count, char **arguments) {
    double start[MOST], largest = 0;
    if (count < 4) return 2;
    port = arguments[1];
    baud = atoi(arguments[2]);
    timeout = atoi(arguments[3]);
    for (int i = 4; i < count; i++) set(arguments[i]);
    if (rtapi_app_main()) return 1;
    printf("starts");
    for (int i = 0; i < axes; i++) printf(" %.4f", *hal->feedback[i]);
    printf("\n");
    if (strcmp(geometry, "direct") == 0) return 0;
    for (int i = 0; i < axes; i++) {
        *hal->position[i] = start[i] = *hal->feedback[i];
        hal->limit[i] = 1;
    }
    *hal->enable = 1;
    for (int time = 0; time < MOVE + STAY && !*hal->fault; time++) {
        takt_read(NULL, 1000000);
        double phase = M_PI * (time < MOVE ? time : MOVE) / MOVE;
        *hal->position[0] = start[0] + WAY / 2 * (1 - cos(phase));
        *hal->velocity[0] = WAY / 2 * M_PI / MOVE * 1e3 * sin(phase);
        takt_write(NULL, 1000000);
        if (fabs(*hal->error[0]) > largest) largest = fabs(*hal->error[0]);
    }
    printf("code %u starved %u skipped %u misses %u knots %u moved %.4f error %.4f\n", *hal->code, *hal->starved, *hal->skipped,
        *hal->misses, *hal->knot, *hal->feedback[0] - start[0], largest);
    *hal->enable = 0;
    takt_write(NULL, 1000000);
    rtapi_app_exit();
    return 0;
}
