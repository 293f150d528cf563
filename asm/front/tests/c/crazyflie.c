/* An attitude estimator with quaternions, in the style of Crazyflie's sensfusion6.c and math3d.h. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>

struct vec { float x; float y; float z; };

static inline struct vec mkvec(float x, float y, float z) { struct vec v; v.x = x; v.y = y; v.z = z; return v; }
static inline struct vec vscl(float s, struct vec v) { return mkvec(s * v.x, s * v.y, s * v.z); }
static inline struct vec vadd(struct vec a, struct vec b) { return mkvec(a.x + b.x, a.y + b.y, a.z + b.z); }
static inline float vdot(struct vec a, struct vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline struct vec vcross(struct vec a, struct vec b)
{
  return mkvec(a.y*b.z - a.z*b.y, a.z*b.x - a.x*b.z, a.x*b.y - a.y*b.x);
}
struct mat33 { float m[3][3]; };
static inline struct vec mvmul(struct mat33 a, struct vec v)
{
  float x = a.m[0][0] * v.x + a.m[0][1] * v.y + a.m[0][2] * v.z;
  float y = a.m[1][0] * v.x + a.m[1][1] * v.y + a.m[1][2] * v.z;
  float z = a.m[2][0] * v.x + a.m[2][1] * v.y + a.m[2][2] * v.z;
  return mkvec(x, y, z);
}

#define DEG_TO_RAD (3.14159265f / 180.0f)
#define TWO_KP_DEF (2.0f * 0.4f)
#define TWO_KI_DEF (2.0f * 0.001f)

float twoKp = TWO_KP_DEF;
float twoKi = TWO_KI_DEF;
static float integralFBx = 0.0f, integralFBy = 0.0f, integralFBz = 0.0f;
static float qw = 1.0f, qx = 0.0f, qy = 0.0f, qz = 0.0f;
static float gravX, gravY, gravZ, baseZacc = 1.0f;
static bool isCalibrated = false;

/* Fast inverse square root: http://en.wikipedia.org/wiki/Fast_inverse_square_root */
static float invSqrt(float x)
{
  float halfx = 0.5f * x;
  float y = x;
  int32_t i = *(int32_t *)&y;
  i = 0x5f3759df - (i >> 1);
  y = *(float *)&i;
  y = y * (1.5f - (halfx * y * y));
  return y;
}

static void estimatedGravityDirection(float *gx, float *gy, float *gz)
{
  *gx = 2 * (qx * qz - qw * qy);
  *gy = 2 * (qw * qx + qy * qz);
  *gz = qw * qw - qx * qx - qy * qy + qz * qz;
}

static void sensfusion6UpdateQImpl(float gx, float gy, float gz, float ax, float ay, float az, float dt)
{
  float recipNorm;
  gx = gx * DEG_TO_RAD;
  gy = gy * DEG_TO_RAD;
  gz = gz * DEG_TO_RAD;

  if (!((ax == 0.0f) && (ay == 0.0f) && (az == 0.0f))) {
    recipNorm = invSqrt(ax * ax + ay * ay + az * az);
    ax *= recipNorm;
    ay *= recipNorm;
    az *= recipNorm;
    const float halfvx = qx * qz - qw * qy;
    const float halfvy = qw * qx + qy * qz;
    const float halfvz = qw * qw - 0.5f + qz * qz;
    const struct vec e = vcross(mkvec(ax, ay, az), mkvec(halfvx, halfvy, halfvz));

    if (twoKi > 0.0f) {
      integralFBx += twoKi * e.x * dt;
      integralFBy += twoKi * e.y * dt;
      integralFBz += twoKi * e.z * dt;
      gx += integralFBx;
      gy += integralFBy;
      gz += integralFBz;
    } else {
      integralFBx = 0.0f;
      integralFBy = 0.0f;
      integralFBz = 0.0f;
    }
    gx += twoKp * e.x;
    gy += twoKp * e.y;
    gz += twoKp * e.z;
  }

  gx *= (0.5f * dt);
  gy *= (0.5f * dt);
  gz *= (0.5f * dt);
  float qa = qw, qb = qx, qc = qy;
  qw += (-qb * gx - qc * gy - qz * gz);
  qx += (qa * gx + qc * gz - qz * gy);
  qy += (qa * gy - qb * gz + qz * gx);
  qz += (qa * gz + qb * gy - qc * gx);
  recipNorm = invSqrt(qw * qw + qx * qx + qy * qy + qz * qz);
  qw *= recipNorm;
  qx *= recipNorm;
  qy *= recipNorm;
  qz *= recipNorm;
}

void step(struct vec gyro, struct vec acc, float q[4], float *zacc, struct vec *turned)
{
  sensfusion6UpdateQImpl(gyro.x, gyro.y, gyro.z, acc.x, acc.y, acc.z, 0.004f);
  estimatedGravityDirection(&gravX, &gravY, &gravZ);
  if (!isCalibrated) {
    baseZacc = acc.x * gravX + acc.y * gravY + acc.z * gravZ;
    isCalibrated = true;
  }
  *zacc = acc.x * gravX + acc.y * gravY + acc.z * gravZ - baseZacc;
  struct mat33 r = { { { 1, -gravZ, gravY }, { gravZ, 1, -gravX }, { -gravY, gravX, 1 } } };
  *turned = vadd(mvmul(r, acc), vscl(vdot(gyro, acc) * 1e-3f, gyro));
  q[0] = qw;
  q[1] = qx;
  q[2] = qy;
  q[3] = qz;
}
