/* A step function in fixed point, in the style that Embedded Coder writes. */
typedef signed char int8_T;
typedef unsigned char uint8_T;
typedef short int16_T;
typedef unsigned short uint16_T;
typedef int int32_T;
typedef unsigned int uint32_T;
typedef float real32_T;
typedef unsigned char boolean_T;

#define IN_NO_ACTIVE_CHILD ((uint8_T)0U)
#define IN_RUN ((uint8_T)1U)
#define IN_FAULT ((uint8_T)2U)

typedef struct {
  int32_T Integrator_DSTATE;
  int16_T UnitDelay_DSTATE;
  int16_T Delay_DSTATE[4];
  uint16_T counter;
  uint8_T is_active;
  uint8_T is_c1;
  boolean_T Relay_Mode;
} DW;
typedef struct { int16_T speed; int16_T target; uint8_T enable; real32_T current; } ExtU;
typedef struct { int16_T duty; uint8_T state; boolean_T over; real32_T filtered; } ExtY;

DW rtDW;
ExtU rtU;
ExtY rtY;

static const int16_T gains[8] = { 410, 512, 640, 768, 900, 1024, 1100, 1200 };

static int32_T mul_s32_sat(int32_T a, int32_T b)
{
  int32_T c = a * b;
  if (c > 134217727) c = 134217727;
  if (c < -134217728) c = -134217728;
  return c;
}

void step(void)
{
  int32_T tmp;
  int16_T rtb_err;
  int16_T rtb_Saturation;
  int16_T rtb_gain;
  uint8_T index;

  if (rtDW.is_active == 0U) {
    rtDW.is_active = 1U;
    rtDW.is_c1 = IN_RUN;
  } else if (rtDW.is_c1 == IN_RUN) {
    if (rtU.speed > 6000 || rtU.speed < -6000) {
      rtDW.is_c1 = IN_FAULT;
      rtDW.counter = 0U;
    }
  } else {
    rtDW.counter++;
    if (rtDW.counter >= 5 && rtU.enable) {
      rtDW.is_c1 = IN_RUN;
    }
  }

  rtb_err = (int16_T)(rtU.target - rtDW.UnitDelay_DSTATE);
  index = (uint8_T)((rtb_err < 0 ? -rtb_err : rtb_err) >> 10);
  if (index > 7) {
    index = 7;
  }
  rtb_gain = gains[index];
  tmp = (rtb_err * rtb_gain) >> 10;
  if (tmp > 32767) {
    tmp = 32767;
  } else if (tmp < -32768) {
    tmp = -32768;
  }
  rtDW.Integrator_DSTATE += mul_s32_sat(13, (int16_T)tmp);
  if (rtDW.Integrator_DSTATE > 4194304) {
    rtDW.Integrator_DSTATE = 4194304;
  } else if (rtDW.Integrator_DSTATE < -4194304) {
    rtDW.Integrator_DSTATE = -4194304;
  }
  tmp += rtDW.Integrator_DSTATE >> 8;
  rtb_Saturation = (int16_T)(tmp > 1000 ? 1000 : tmp < -1000 ? -1000 : tmp);

  if (rtDW.is_c1 == IN_FAULT || !rtU.enable) {
    rtb_Saturation = 0;
    rtDW.Integrator_DSTATE = 0;
  }
  rtDW.UnitDelay_DSTATE = (int16_T)((rtDW.Delay_DSTATE[0] + rtDW.Delay_DSTATE[1] + rtDW.Delay_DSTATE[2] + rtDW.Delay_DSTATE[3]) / 4);
  rtDW.Delay_DSTATE[0] = rtDW.Delay_DSTATE[1];
  rtDW.Delay_DSTATE[1] = rtDW.Delay_DSTATE[2];
  rtDW.Delay_DSTATE[2] = rtDW.Delay_DSTATE[3];
  rtDW.Delay_DSTATE[3] = rtU.speed;
  rtDW.Relay_Mode = (boolean_T)((rtU.current >= 20.0F) || ((!(rtU.current <= 15.0F)) && rtDW.Relay_Mode));

  rtY.duty = rtb_Saturation;
  rtY.state = rtDW.is_c1;
  rtY.over = rtDW.Relay_Mode;
  rtY.filtered = rtU.current * 0.125F + (real32_T)rtDW.UnitDelay_DSTATE * 0.001F;
}
