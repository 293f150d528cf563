// SPDX-License-Identifier: MIT OR Apache-2.0
// Kernels over the arrays of programs/taclebench, in C, single precision, written from the algorithms.
//
// A macro, such as KERNEL_lms, chooses one. It computes the same as the program of that name, from inputs that do not matter for its time.

#define PI 3.14159265358979323846f

// Inputs between -1 and 1, from a linear congruential generator.
static unsigned state = 1;
static float next(void)
{
    state = state * 1664525u + 1013904223u;
    return (float)(int)state * (1.0f / 2147483648.0f);
}

static void fill(float *values, int count)
{
    for (int i = 0; i < count; i++)
        values[i] = next();
}

#if defined KERNEL_cosf
enum { RESULTS = 200 };
float x[200], result[RESULTS];

void prepare(void)
{
    fill(x, 200);
    for (int i = 0; i < 200; i++)
        x[i] *= 20.0f;
}

// The reduction to a quarter of a turn subtracts π in two parts (Cody and Waite); a polynomial follows.
__attribute__((noinline)) void kernel(void)
{
    for (int i = 0; i < 200; i++) {
        float turns = x[i] * (1.0f / PI) + 0.5f;
        int n = (int)(turns + (turns < 0 ? -0.5f : 0.5f));
        float half = (float)n - 0.5f;
        float r = (x[i] - half * 3.140625f) - half * 9.67653589793e-4f;
        float s = r * r;
        float p = r + r * s * (-1.6666654611e-1f + s * (8.3321608736e-3f + s * -1.9515295891e-4f));
        result[i] = n & 1 ? -p : p;
    }
}

#elif defined KERNEL_deg2rad
enum { RESULTS = 361 };
float x[361], result[RESULTS];

void prepare(void)
{
    for (int i = 0; i < 361; i++)
        x[i] = (float)i;
}

__attribute__((noinline)) void kernel(void)
{
    for (int i = 0; i < 361; i++)
        result[i] = x[i] * (PI / 180.0f);
}

#elif defined KERNEL_fir2dim
enum { RESULTS = 16 };
float c[9], image[16], a[36], result[RESULTS];

void prepare(void)
{
    fill(c, 9);
    fill(image, 16);
}

__attribute__((noinline)) void kernel(void)
{
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            a[6 * (i + 1) + j + 1] = image[4 * i + j];
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            float sum = 0;
            for (int k = 0; k < 3; k++)
                for (int l = 0; l < 3; l++)
                    sum += c[3 * k + l] * a[6 * (i + k) + j + l];
            result[4 * i + j] = sum;
        }
}

#elif defined KERNEL_iir
enum { RESULTS = 1 };
float c[20], w[5], x[1], result[RESULTS];

void prepare(void)
{
    fill(c, 20);
    fill(w, 5);
    fill(x, 1);
}

__attribute__((noinline)) void kernel(void)
{
    float v = x[0];
    for (int f = 0; f < 4; f++) {
        const float *k = c + 5 * f;
        float s = v - k[0] * w[f] - k[1] * w[f + 1];
        v = k[2] * s + k[3] * w[f] + k[4] * w[f + 1];
    }
    result[0] = v;
}

#elif defined KERNEL_lms
enum { RESULTS = 201 };
float x[222], b[21], result[RESULTS];

void prepare(void)
{
    fill(x + 20, 202);
}

__attribute__((noinline)) void kernel(void)
{
    for (int k = 0; k < 21; k++)
        b[k] = 0;
    for (int i = 0; i < 201; i++) {
        float y = 0;
        for (int k = 0; k < 21; k++)
            y += b[k] * x[i + 20 - k];
        result[i] = y;
        float e = (0.5f * 0.02f / 21.0f) * (x[i + 21] - y);
        for (int k = 0; k < 21; k++)
            b[k] += e * x[i + 20 - k];
    }
}

#elif defined KERNEL_ludcmp
enum { RESULTS = 6 };
float A[6][6], b[6], y[6], result[RESULTS];

void prepare(void)
{
    fill(A[0], 36);
    fill(b, 6);
    for (int i = 0; i < 6; i++)
        A[i][i] += 8.0f;
}

// In place: the factors are read only in the original, whose matrix is not needed again.
__attribute__((noinline)) void kernel(void)
{
    for (int i = 0; i < 6; i++) {
        for (int j = i; j < 6; j++)
            for (int k = 0; k < i; k++)
                A[i][j] -= A[i][k] * A[k][j];
        float r = 1.0f / A[i][i];
        for (int j = i + 1; j < 6; j++) {
            for (int k = 0; k < i; k++)
                A[j][i] -= A[j][k] * A[k][i];
            A[j][i] *= r;
        }
        y[i] = b[i];
        for (int k = 0; k < i; k++)
            y[i] -= A[i][k] * y[k];
    }
    for (int i = 5; i >= 0; i--) {
        float sum = y[i];
        for (int k = i + 1; k < 6; k++)
            sum -= A[i][k] * result[k];
        result[i] = sum / A[i][i];
    }
}

#elif defined KERNEL_minver
enum { RESULTS = 10 };
float A[3][3], a[3][6], result[RESULTS];

void prepare(void)
{
    fill(A[0], 9);
}

static float size(float value)
{
    return value < 0 ? -value : value;
}

// Gauss and Jordan with pivoting by exchange of rows.
__attribute__((noinline)) void kernel(void)
{
    float d = 1;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            a[i][j] = A[i][j];
            a[i][j + 3] = i == j;
        }
    for (int k = 0; k < 3; k++) {
        int pivot = k;
        for (int i = k + 1; i < 3; i++)
            if (size(a[i][k]) > size(a[pivot][k]))
                pivot = i;
        if (pivot != k) {
            d = -d;
            for (int j = k; j < 6; j++) {
                float held = a[k][j];
                a[k][j] = a[pivot][j];
                a[pivot][j] = held;
            }
        }
        d *= a[k][k];
        float r = 1.0f / a[k][k];
        for (int j = k + 1; j < 6; j++)
            a[k][j] *= r;
        for (int i = 0; i < 3; i++)
            if (i != k)
                for (int j = k + 1; j < 6; j++)
                    a[i][j] -= a[i][k] * a[k][j];
    }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            result[3 * i + j] = a[i][j + 3];
    result[9] = d;
}

#elif defined KERNEL_st
enum { RESULTS = 9 };
float A[1000], B[1000], result[RESULTS];

void prepare(void)
{
    fill(A, 1000);
    fill(B, 1000);
}

__attribute__((noinline)) void kernel(void)
{
    float s = 0, t = 0, n = 0, v = 0, w = 0;
    for (int i = 0; i < 1000; i++) {
        s += A[i];
        t += B[i];
    }
    float m = s * (1.0f / 1000), p = t * (1.0f / 1000);
    for (int i = 0; i < 1000; i++) {
        float a = A[i] - m, b = B[i] - p;
        n += a * b;
        v += a * a;
        w += b * b;
    }
    float of[RESULTS] = { s, t, m, p, v * (1.0f / 1000), w * (1.0f / 1000), __builtin_sqrtf(v * (1.0f / 1000)),
                          __builtin_sqrtf(w * (1.0f / 1000)), n / (__builtin_sqrtf(v) * __builtin_sqrtf(w)) };
    for (int i = 0; i < RESULTS; i++)
        result[i] = of[i];
}
#endif

// Results go to standard output as words, natively and in QEMU, and to a word of the simulated core's memory.
#ifdef __riscv
#define MARK (*(volatile unsigned *)0x40000000)

void start(void)
{
    prepare();
    MARK = 1;
    kernel();
    MARK = 2;
    for (int i = 0; i < RESULTS; i++)
        *(volatile float *)0x40000004 = result[i];
    MARK = 3;
    for (;;) {
    }
}

__asm__(".section .text.entry\n.globl _start\n_start:\nli sp, 0x20000\nli t0, 0x2000\ncsrs mstatus, t0\nj start\n");
#elif !defined __TAKT__
static void show(const void *bytes, unsigned count);

int main(void)
{
    prepare();
    kernel();
    show(result, sizeof result);
    return 0;
}

#ifdef __arm__
// Linux' system calls, for QEMU.
static int call(int number, int a, int b, int c)
{
    register int r0 __asm__("r0") = a, r1 __asm__("r1") = b, r2 __asm__("r2") = c, r7 __asm__("r7") = number;
    __asm__ volatile("svc 0" : "+r"(r0) : "r"(r1), "r"(r2), "r"(r7) : "memory");
    return r0;
}

static void show(const void *bytes, unsigned count)
{
    call(4, 1, (int)bytes, (int)count);
}

void _start(void)
{
    call(1, main(), 0, 0);
}
#else
#include <unistd.h>
static void show(const void *bytes, unsigned count)
{
    if (write(1, bytes, count) < 0)
        _exit(1);
}
#endif
#endif
