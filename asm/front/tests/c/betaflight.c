/* A rate controller with filters, in the style of Betaflight's pid.c and filter.c. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#define FAST_CODE
#define FAST_DATA_ZERO_INIT
#define M_PIf 3.14159265358979323846f
#define XYZ_AXIS_COUNT 3
#define DTERM_SCALE 0.000529f
#define ITERM_SCALE 0.244381f
#define PTERM_SCALE 0.032029f

typedef enum { FD_ROLL, FD_PITCH, FD_YAW } flight_dynamics_index_t;
struct filter_s;
typedef struct filter_s filter_t;
typedef float (*filterApplyFnPtr)(filter_t *filter, float input);

typedef struct pt1Filter_s { float state; float k; } pt1Filter_t;
typedef struct biquadFilter_s { float b0, b1, b2, a1, a2; float x1, x2, y1, y2; } biquadFilter_t;
typedef struct pidf_s { uint8_t P, I, D; uint16_t F; } pidf_t;
typedef struct pidAxisData_s { float P, I, D, F, Sum; } pidAxisData_t;
typedef struct pidCoefficient_s { float Kp, Ki, Kd, Kf; } pidCoefficient_t;

typedef struct pidRuntime_s {
    float dT, pidFrequency;
    pidCoefficient_t pidCoefficient[XYZ_AXIS_COUNT];
    pt1Filter_t dtermLowpass[XYZ_AXIS_COUNT];
    biquadFilter_t dtermNotch[XYZ_AXIS_COUNT];
    float previousGyroRateDterm[XYZ_AXIS_COUNT];
    float previousSetpoint[XYZ_AXIS_COUNT];
    float maxVelocity[XYZ_AXIS_COUNT];
    float itermLimit;
    bool pidStabilisationEnabled;
} pidRuntime_t;

static const pidf_t pidf[XYZ_AXIS_COUNT] = { { 45, 80, 40, 120 }, { 47, 84, 46, 125 }, { 45, 80, 0, 120 } };
static FAST_DATA_ZERO_INIT pidAxisData_t pidData[XYZ_AXIS_COUNT];
static FAST_DATA_ZERO_INIT pidRuntime_t pidRuntime;
static filterApplyFnPtr dtermLowpassApplyFn, dtermNotchApplyFn;

static inline float constrainf(float amt, float low, float high)
{
    if (amt < low)
        return low;
    else if (amt > high)
        return high;
    else
        return amt;
}

static float sin_approx(float x)
{
    int32_t xint = x;
    if (xint < -32 || xint > 32) return 0.0f;
    while (x > M_PIf) x -= (2.0f * M_PIf);
    while (x < -M_PIf) x += (2.0f * M_PIf);
    if (x > (0.5f * M_PIf)) x = (0.5f * M_PIf) - (x - (0.5f * M_PIf));
    else if (x < -(0.5f * M_PIf)) x = -(0.5f * M_PIf) - ((0.5f * M_PIf) + x);
    float x2 = x * x;
    return x + x * x2 * (-1.666665710e-1f + x2 * (8.333017292e-3f + x2 * (-1.980661520e-4f + x2 * 2.600054768e-6f)));
}

static float cos_approx(float x) { return sin_approx(x + (0.5f * M_PIf)); }

static float pt1FilterGain(float f_cut, float dT)
{
    float omega = 2.0f * M_PIf * f_cut * dT;
    return omega / (omega + 1.0f);
}

static void pt1FilterInit(pt1Filter_t *filter, float k) { filter->state = 0.0f; filter->k = k; }

FAST_CODE static float pt1FilterApply(pt1Filter_t *filter, float input)
{
    filter->state = filter->state + filter->k * (input - filter->state);
    return filter->state;
}

static void biquadFilterInitNotch(biquadFilter_t *filter, float filterFreq, uint32_t refreshRate, float Q)
{
    const float omega = 2.0f * M_PIf * filterFreq * refreshRate * 0.000001f;
    const float sn = sin_approx(omega), cs = cos_approx(omega);
    const float alpha = sn / (2.0f * Q);
    filter->b0 = 1; filter->b1 = -2 * cs; filter->b2 = 1;
    filter->a1 = filter->b1; filter->a2 = 1 - alpha;
    const float a0 = 1 + alpha;
    filter->b0 /= a0; filter->b1 /= a0; filter->b2 /= a0; filter->a1 /= a0; filter->a2 /= a0;
    filter->x1 = filter->x2 = 0;
    filter->y1 = filter->y2 = 0;
}

FAST_CODE static float biquadFilterApplyDF1(biquadFilter_t *filter, float input)
{
    const float result = filter->b0 * input + filter->b1 * filter->x1 + filter->b2 * filter->x2
        - filter->a1 * filter->y1 - filter->a2 * filter->y2;
    filter->x2 = filter->x1;
    filter->x1 = input;
    filter->y2 = filter->y1;
    filter->y1 = result;
    return result;
}

void init(void)
{
    pidRuntime.dT = 125 * 1e-6f;
    pidRuntime.pidFrequency = 1.0f / pidRuntime.dT;
    dtermLowpassApplyFn = (filterApplyFnPtr)pt1FilterApply;
    dtermNotchApplyFn = (filterApplyFnPtr)biquadFilterApplyDF1;
    for (int axis = FD_ROLL; axis <= FD_YAW; axis++) {
        pidRuntime.pidCoefficient[axis].Kp = PTERM_SCALE * pidf[axis].P;
        pidRuntime.pidCoefficient[axis].Ki = ITERM_SCALE * pidf[axis].I;
        pidRuntime.pidCoefficient[axis].Kd = DTERM_SCALE * pidf[axis].D;
        pidRuntime.pidCoefficient[axis].Kf = 0.013754f * (pidf[axis].F / 100.0f);
        pt1FilterInit(&pidRuntime.dtermLowpass[axis], pt1FilterGain(100, pidRuntime.dT));
        biquadFilterInitNotch(&pidRuntime.dtermNotch[axis], 260, 125, 1.8f);
        pidRuntime.maxVelocity[axis] = 50 * 1000 * pidRuntime.dT;
    }
    pidRuntime.itermLimit = 400;
    pidRuntime.pidStabilisationEnabled = true;
}

FAST_CODE static float accelerationLimit(int axis, float currentPidSetpoint)
{
    static float previousSetpoint[XYZ_AXIS_COUNT];
    const float currentVelocity = currentPidSetpoint - previousSetpoint[axis];
    if (fabsf(currentVelocity) > pidRuntime.maxVelocity[axis]) {
        currentPidSetpoint = (currentVelocity > 0) ? previousSetpoint[axis] + pidRuntime.maxVelocity[axis]
                                                   : previousSetpoint[axis] - pidRuntime.maxVelocity[axis];
    }
    previousSetpoint[axis] = currentPidSetpoint;
    return currentPidSetpoint;
}

void step(const float setpointRate[3], const float gyroADCf[3], bool armed, float axisPID[3])
{
    for (int axis = FD_ROLL; axis <= FD_YAW; ++axis) {
        const float setpoint = accelerationLimit(axis, setpointRate[axis]);
        const float gyroRate = gyroADCf[axis];
        const float errorRate = setpoint - gyroRate;
        const float previousIterm = pidData[axis].I;
        pidData[axis].P = pidRuntime.pidCoefficient[axis].Kp * errorRate;
        const float Ki = pidRuntime.pidCoefficient[axis].Ki;
        pidData[axis].I = constrainf(previousIterm + Ki * pidRuntime.dT * errorRate, -pidRuntime.itermLimit, pidRuntime.itermLimit);
        if (pidRuntime.pidCoefficient[axis].Kd > 0) {
            float gyroRateDterm = dtermNotchApplyFn((filter_t *)&pidRuntime.dtermNotch[axis], gyroRate);
            gyroRateDterm = dtermLowpassApplyFn((filter_t *)&pidRuntime.dtermLowpass[axis], gyroRateDterm);
            const float delta = -(gyroRateDterm - pidRuntime.previousGyroRateDterm[axis]) * pidRuntime.pidFrequency;
            pidData[axis].D = pidRuntime.pidCoefficient[axis].Kd * delta;
            pidRuntime.previousGyroRateDterm[axis] = gyroRateDterm;
        } else {
            pidData[axis].D = 0;
        }
        const float pidSetpointDelta = setpoint - pidRuntime.previousSetpoint[axis];
        pidRuntime.previousSetpoint[axis] = setpoint;
        pidData[axis].F = pidRuntime.pidCoefficient[axis].Kf * pidSetpointDelta * pidRuntime.pidFrequency;
        if (!armed) {
            pidData[axis].I = 0;
        }
        pidData[axis].Sum = pidData[axis].P + pidData[axis].I + pidData[axis].D + pidData[axis].F;
        axisPID[axis] = constrainf(pidData[axis].Sum, -500.0f, 500.0f);
    }
}
