/* SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * A master of FMI 2.0 that only measures: in each period all inputs are set, a step is made, all outputs are read.
 *
 *   master LIBRARY RESOURCES GUID PERIOD PERIODS ROWS NR NI MR MI < numbers
 *
 * NR, NI are the numbers of inputs that are Real and Integer, MR, MI those of outputs. The numbers are the value references in this order,
 * then ROWS rows of inputs. Prints periods per second, and a sum of all outputs. */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

typedef void *Component;
typedef struct { void *logger, *allocate, *release, *finished, *environment; } Callbacks;

static void *library;

static void *function(const char *name) {
    void *found = dlsym(library, name);
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
    if (count != 11 || !(library = dlopen(argument[1], RTLD_NOW))) { fprintf(stderr, "%s\n", count == 11 ? dlerror() : "usage"); return 1; }
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
    expect(leave(component), "leave");
    struct timespec begin, end;
    double sum = 0;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &begin);
    for (long i = 0; i < periods; i++) {
        size_t row = (size_t)(i % rows);
        expect(set_real(component, references[0], sizes[0], reals + row * sizes[0]), "set");
        expect(set_integer(component, references[1], sizes[1], integers + row * sizes[1]), "set");
        expect(step(component, (double)i * period, period, 1), "step");
        expect(get_real(component, references[2], sizes[2], results), "get");
        expect(get_integer(component, references[3], sizes[3], counts), "get");
        for (size_t k = 0; k < sizes[2]; k++) sum += results[k];
        for (size_t k = 0; k < sizes[3]; k++) sum += counts[k];
    }
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &end);
    double seconds = (double)(end.tv_sec - begin.tv_sec) + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec);
    printf("%.0f %.17g\n", (double)periods / seconds, sum);
    return 0;
}
