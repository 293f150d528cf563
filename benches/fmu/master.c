/* SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * A master of FMI 2.0 for Linux and Windows: in each period all inputs are set, a step is made, all outputs are read.
 *
 *   master LIBRARY RESOURCES GUID PERIOD PERIODS ROWS NR NI MR MI [print] < numbers
 *
 * NR, NI are the numbers of inputs that are Real and Integer, MR, MI those of outputs. The numbers are the value references in this order,
 * then ROWS rows of inputs, of which the first is set before the initialisation ends. Prints periods per second, and a sum of all outputs;
 * with `print` the outputs of each period in place of both: binary32 as its bits, integers in decimal. */
#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h>
#endif
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef void *Component;
typedef struct { void *logger, *allocate, *release, *finished, *environment; } Callbacks;

#ifdef _WIN32
static HMODULE library;
static int load(const char *path) { return (library = LoadLibraryA(path)) != NULL; }
static void *find(const char *name) { return (void *)(uintptr_t)GetProcAddress(library, name); }
static const char *reason(void) { return "LoadLibrary fails"; }
static double seconds(void) { return (double)clock() / CLOCKS_PER_SEC; }
#else
static void *library;
static int load(const char *path) { return (library = dlopen(path, RTLD_NOW)) != NULL; }
static void *find(const char *name) { return dlsym(library, name); }
static const char *reason(void) { return dlerror(); }
static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}
#endif

static void *function(const char *name) {
    void *found = find(name);
    if (!found) { fprintf(stderr, "no function %s\n", name); exit(1); }
    return found;
}

static void expect(int status, const char *what) {
    if (status != 0) { fprintf(stderr, "%s: status %d\n", what, status); exit(1); }
}

static double number(void) {
    double value;
    if (scanf("%lf", &value) != 1) { fprintf(stderr, "too few numbers\n"); exit(1); }
    return value;
}

int main(int count, char **argument) {
    int prints = count == 12 && !strcmp(argument[11], "print");
    if (count != 11 && !prints) { fprintf(stderr, "usage: see the comment in master.c\n"); return 1; }
    if (!load(argument[1])) { fprintf(stderr, "%s: %s\n", argument[1], reason()); return 1; }
    double period = atof(argument[4]);
    long periods = atol(argument[5]), rows = atol(argument[6]);
    size_t sizes[4];
    unsigned *references[4];
    for (int i = 0; i < 4; i++) {
        sizes[i] = (size_t)atol(argument[7 + i]);
        references[i] = calloc(sizes[i] + 1, sizeof(unsigned));
        for (size_t k = 0; k < sizes[i]; k++) references[i][k] = (unsigned)number();
    }
    double *reals = calloc((size_t)rows * sizes[0] + 1, sizeof(double)), *results = calloc(sizes[2] + 1, sizeof(double));
    int *integers = calloc((size_t)rows * sizes[1] + 1, sizeof(int)), *counts = calloc(sizes[3] + 1, sizeof(int));
    for (long row = 0; row < rows; row++) {
        for (size_t k = 0; k < sizes[0]; k++) reals[(size_t)row * sizes[0] + k] = number();
        for (size_t k = 0; k < sizes[1]; k++) integers[(size_t)row * sizes[1] + k] = (int)number();
    }
    Component (*instantiate)(const char *, int, const char *, const char *, const Callbacks *, int, int) = function("fmi2Instantiate");
    int (*setup)(Component, int, double, double, int, double) = function("fmi2SetupExperiment");
    int (*enter)(Component) = function("fmi2EnterInitializationMode"), (*leave)(Component) = function("fmi2ExitInitializationMode");
    int (*set_real)(Component, const unsigned *, size_t, const double *) = function("fmi2SetReal");
    int (*set_integer)(Component, const unsigned *, size_t, const int *) = function("fmi2SetInteger");
    int (*get_real)(Component, const unsigned *, size_t, double *) = function("fmi2GetReal");
    int (*get_integer)(Component, const unsigned *, size_t, int *) = function("fmi2GetInteger");
    int (*step)(Component, double, double, int) = function("fmi2DoStep");
    Callbacks callbacks = {0};
    Component component = instantiate("one", 1, argument[3], argument[2], &callbacks, 0, 0);
    if (!component) { fprintf(stderr, "no instance\n"); return 1; }
    expect(setup(component, 0, 0, 0, 0, 0), "setup");
    expect(enter(component), "enter");
    if (rows > 0) {
        expect(set_real(component, references[0], sizes[0], reals), "set");
        expect(set_integer(component, references[1], sizes[1], integers), "set");
    }
    expect(leave(component), "leave");
    double sum = 0, begin = seconds();
    for (long i = 0; i < periods; i++) {
        size_t row = (size_t)(i % rows);
        expect(set_real(component, references[0], sizes[0], reals + row * sizes[0]), "set");
        expect(set_integer(component, references[1], sizes[1], integers + row * sizes[1]), "set");
        expect(step(component, (double)i * period, period, 1), "step");
        expect(get_real(component, references[2], sizes[2], results), "get");
        expect(get_integer(component, references[3], sizes[3], counts), "get");
        for (size_t k = 0; k < sizes[2]; k++) sum += results[k];
        for (size_t k = 0; k < sizes[3]; k++) sum += counts[k];
        if (!prints) continue;
        for (size_t k = 0; k < sizes[2]; k++) {
            float value = (float)results[k];
            uint32_t bits;
            memcpy(&bits, &value, sizeof bits);
            printf("%08lx ", (unsigned long)bits);
        }
        for (size_t k = 0; k < sizes[3]; k++) printf("%d ", counts[k]);
        printf("\n");
    }
    if (!prints) printf("%.0f %.17g\n", (double)periods / (seconds() - begin), sum);
    return 0;
}
