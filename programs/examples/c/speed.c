/* SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * A motor's speed controller, as one writes it for a microcontroller: speed from an encoder's counts, with a median of three against
 * miscounts and a low-pass filter, then a PI controller that stops integrating at the limit. docs/c.md goes from here to cycles.
 */
#include <math.h>
#include <stdint.h>

#define T 1e-3f                         /* s, the period */
#define COUNT (6.2831853f / 4096.0f)    /* rad */
#define LIMIT 24.0f                     /* V */

struct speed {
    float kp, ki;                       /* V·s/rad, V/rad */
    int32_t count;                      /* the encoder's, in the period before */
    float last[3];                      /* rad/s, the latest first */
    float filtered;                     /* rad/s */
    float sum;                          /* V */
};

static float median(const float x[3])
{
    float low = fminf(x[0], x[1]), high = fmaxf(x[0], x[1]);
    return fmaxf(low, fminf(high, x[2]));
}

void speed_init(struct speed *s)
{
    s->kp = 0.1f;
    s->ki = 2.0f;
    s->count = 0;
    for (int i = 0; i < 3; i++)
        s->last[i] = 0.0f;
    s->filtered = 0.0f;
    s->sum = 0.0f;
}

/* The motor's voltage from the wanted speed and the encoder. */
float speed_step(struct speed *s, float w_ref, int32_t count)
{
    for (int i = 2; i > 0; i--)
        s->last[i] = s->last[i - 1];
    s->last[0] = (float)(count - s->count) * (COUNT / T);
    s->count = count;
    s->filtered += 0.3f * (median(s->last) - s->filtered);

    float e = w_ref - s->filtered;
    float u = s->kp * e + s->sum;
    if (fabsf(u) > LIMIT)
        return copysignf(LIMIT, u);
    s->sum += s->ki * T * e;
    return u;
}
