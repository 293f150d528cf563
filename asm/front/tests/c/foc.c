/* Field-oriented control of a motor, in the style of VESC's mcpwm_foc.c and foc_math.c. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#ifndef M_PI
#define M_PI 3.14159265358979323846
#endif
#define SQ(x) ((x) * (x))
#define NORM2_f(x, y) (sqrtf(SQ(x) + SQ(y)))
#define ONE_BY_SQRT3 ((float)0.57735026919)
#define TWO_BY_SQRT3 ((float)(2.0 * 0.57735026919))
#define SQRT3_BY_2 ((float)0.86602540378)
#define UTILS_LP_FAST(value, sample, filter_constant) (value -= (filter_constant) * ((value) - (sample)))

typedef struct {
	float foc_current_kp, foc_current_ki;
	float foc_motor_l, foc_motor_flux_linkage;
	float l_max_duty, l_current_max;
	float foc_pll_kp, foc_pll_ki;
} mc_configuration;

typedef struct {
	float id_target, iq_target;
	float i_alpha, i_beta, i_abs;
	float id, iq, id_filter, iq_filter;
	float vd, vq, vd_int, vq_int;
	float v_bus, phase_sin, phase_cos;
	float mod_alpha_raw, mod_beta_raw;
	uint32_t svm_sector;
} motor_state_t;

typedef struct {
	mc_configuration *m_conf;
	motor_state_t m_motor_state;
	float m_pll_phase, m_pll_speed;
	int m_ramp;
} motor_all_state_t;

static mc_configuration conf = {
	.foc_current_kp = 0.03, .foc_current_ki = 50.0, .foc_motor_l = 7e-6, .foc_motor_flux_linkage = 0.00245,
	.l_max_duty = 0.95, .l_current_max = 60.0, .foc_pll_kp = 2000.0, .foc_pll_ki = 30000.0,
};
static motor_all_state_t m_motor_1 = { .m_conf = &conf };

static inline void utils_norm_angle_rad(float *angle)
{
#pragma takt loop_bound(3)
	while (*angle < -M_PI) { *angle += 2.0 * M_PI; }
#pragma takt loop_bound(3)
	while (*angle >= M_PI) { *angle -= 2.0 * M_PI; }
}

static void utils_truncate_number_abs(float *number, float max)
{
	if (*number > max) {
		*number = max;
	} else if (*number < -max) {
		*number = -max;
	}
}

static bool utils_saturate_vector_2d(float *x, float *y, float max)
{
	bool retval = false;
	float mag = NORM2_f(*x, *y);
	max = fabsf(max);
	if (mag < 1e-10) {
		mag = 1e-10;
	}
	if (mag > max) {
		const float f = max / mag;
		*x *= f;
		*y *= f;
		retval = true;
	}
	return retval;
}

static void utils_fast_sincos_better(float angle, float *sin, float *cos)
{
	utils_norm_angle_rad(&angle);
	if (angle < 0.0) {
		*sin = 1.27323954 * angle + 0.405284735 * angle * angle;
		if (*sin < 0.0) {
			*sin = 0.225 * (*sin * -*sin - *sin) + *sin;
		} else {
			*sin = 0.225 * (*sin * *sin - *sin) + *sin;
		}
	} else {
		*sin = 1.27323954 * angle - 0.405284735 * angle * angle;
		if (*sin < 0.0) {
			*sin = 0.225 * (*sin * -*sin - *sin) + *sin;
		} else {
			*sin = 0.225 * (*sin * *sin - *sin) + *sin;
		}
	}
	angle += 0.5 * M_PI;
	if (angle > M_PI) {
		angle -= 2.0 * M_PI;
	}
	if (angle < 0.0) {
		*cos = 1.27323954 * angle + 0.405284735 * angle * angle;
		*cos = 0.225 * (*cos * -*cos - *cos) + *cos;
	} else {
		*cos = 1.27323954 * angle - 0.405284735 * angle * angle;
		*cos = 0.225 * (*cos * *cos - *cos) + *cos;
	}
}

static void foc_pll_run(float phase, float dt, float *phase_var, float *speed_var, mc_configuration *conf)
{
	float delta_theta = phase - *phase_var;
	utils_norm_angle_rad(&delta_theta);
	*phase_var += (*speed_var + conf->foc_pll_kp * delta_theta) * dt;
	utils_norm_angle_rad((float *)phase_var);
	*speed_var += conf->foc_pll_ki * delta_theta * dt;
}

/* Magnitude must not be larger than sqrt(3)/2, or 0.866 to avoid overmodulation */
static void foc_svm(float alpha, float beta, uint32_t PWMFullDutyCycle,
		uint32_t *tAout, uint32_t *tBout, uint32_t *tCout, uint32_t *svm_sector)
{
	uint32_t sector;

	if (beta >= 0.0f) {
		if (alpha >= 0.0f) {
			sector = (ONE_BY_SQRT3 * beta > alpha) ? 2 : 1;
		} else {
			sector = (-ONE_BY_SQRT3 * beta > alpha) ? 3 : 2;
		}
	} else {
		if (alpha >= 0.0f) {
			sector = (-ONE_BY_SQRT3 * beta > alpha) ? 5 : 6;
		} else {
			sector = (ONE_BY_SQRT3 * beta > alpha) ? 4 : 5;
		}
	}

	int tA, tB, tC;
	switch (sector) {
	case 1: {
		int t1 = (alpha - ONE_BY_SQRT3 * beta) * PWMFullDutyCycle;
		int t2 = (TWO_BY_SQRT3 * beta) * PWMFullDutyCycle;
		tA = (PWMFullDutyCycle + t1 + t2) / 2;
		tB = tA - t1;
		tC = tB - t2;
		break;
	}
	case 2: {
		int t2 = (alpha + ONE_BY_SQRT3 * beta) * PWMFullDutyCycle;
		int t3 = (-alpha + ONE_BY_SQRT3 * beta) * PWMFullDutyCycle;
		tB = (PWMFullDutyCycle + t2 + t3) / 2;
		tA = tB - t3;
		tC = tA - t2;
		break;
	}
	case 3: {
		int t3 = (TWO_BY_SQRT3 * beta) * PWMFullDutyCycle;
		int t4 = (-alpha - ONE_BY_SQRT3 * beta) * PWMFullDutyCycle;
		tB = (PWMFullDutyCycle + t3 + t4) / 2;
		tC = tB - t3;
		tA = tC - t4;
		break;
	}
	case 4: {
		int t4 = (-alpha + ONE_BY_SQRT3 * beta) * PWMFullDutyCycle;
		int t5 = (-TWO_BY_SQRT3 * beta) * PWMFullDutyCycle;
		tC = (PWMFullDutyCycle + t4 + t5) / 2;
		tB = tC - t5;
		tA = tB - t4;
		break;
	}
	case 5: {
		int t5 = (-alpha - ONE_BY_SQRT3 * beta) * PWMFullDutyCycle;
		int t6 = (alpha - ONE_BY_SQRT3 * beta) * PWMFullDutyCycle;
		tC = (PWMFullDutyCycle + t5 + t6) / 2;
		tA = tC - t5;
		tB = tA - t6;
		break;
	}
	default: {
		int t6 = (-TWO_BY_SQRT3 * beta) * PWMFullDutyCycle;
		int t1 = (alpha + ONE_BY_SQRT3 * beta) * PWMFullDutyCycle;
		tA = (PWMFullDutyCycle + t6 + t1) / 2;
		tC = tA - t1;
		tB = tC - t6;
		break;
	}
	}

	int t_max = PWMFullDutyCycle * (1.0 - 0.02);
	if (tA < 0) tA = 0; else if (tA > t_max) tA = t_max;
	if (tB < 0) tB = 0; else if (tB > t_max) tB = t_max;
	if (tC < 0) tC = 0; else if (tC > t_max) tC = t_max;
	*tAout = tA;
	*tBout = tB;
	*tCout = tC;
	*svm_sector = sector;
}

static void control_current(motor_all_state_t *motor, float dt)
{
	motor_state_t *state_m = &motor->m_motor_state;
	mc_configuration *conf_now = motor->m_conf;
	const float s = state_m->phase_sin, c = state_m->phase_cos;

	state_m->id = c * state_m->i_alpha + s * state_m->i_beta;
	state_m->iq = c * state_m->i_beta - s * state_m->i_alpha;
	UTILS_LP_FAST(state_m->id_filter, state_m->id, 0.1f);
	UTILS_LP_FAST(state_m->iq_filter, state_m->iq, 0.1f);

	float Ierr_d = state_m->id_target - state_m->id;
	float Ierr_q = state_m->iq_target - state_m->iq;
	state_m->vd_int += Ierr_d * (conf_now->foc_current_ki * dt);
	state_m->vq_int += Ierr_q * (conf_now->foc_current_ki * dt);
	state_m->vd = state_m->vd_int + Ierr_d * conf_now->foc_current_kp;
	state_m->vq = state_m->vq_int + Ierr_q * conf_now->foc_current_kp;

	const float w = motor->m_pll_speed;
	state_m->vd -= w * conf_now->foc_motor_l * state_m->iq_filter;
	state_m->vq += w * (conf_now->foc_motor_l * state_m->id_filter + conf_now->foc_motor_flux_linkage);

	float max_v_mag = ONE_BY_SQRT3 * conf_now->l_max_duty * state_m->v_bus;
	utils_truncate_number_abs(&state_m->vd_int, max_v_mag);
	utils_truncate_number_abs(&state_m->vq_int, max_v_mag);
	utils_saturate_vector_2d(&state_m->vd, &state_m->vq, max_v_mag);

	const float voltage_normalize = 1.5f / state_m->v_bus;
	const float mod_d = state_m->vd * voltage_normalize, mod_q = state_m->vq * voltage_normalize;
	state_m->mod_alpha_raw = c * mod_d - s * mod_q;
	state_m->mod_beta_raw = c * mod_q + s * mod_d;
	state_m->i_abs = NORM2_f(state_m->id, state_m->iq);
}

void step(const float i[3], float v_bus, float phase, float torque, uint32_t pwm[3], uint32_t *sector)
{
	motor_all_state_t *motor = &m_motor_1;
	motor_state_t *state_m = &motor->m_motor_state;
	const float dt = 1.0 / 20000.0;

	if (motor->m_ramp < 10) {
		motor->m_ramp++;
	}
	state_m->v_bus = v_bus > 10.0 ? v_bus : 10.0;
	state_m->id_target = 0.0;
	state_m->iq_target = torque * (float)motor->m_ramp * 0.1;
	utils_truncate_number_abs(&state_m->iq_target, motor->m_conf->l_current_max);

	state_m->i_alpha = i[0];
	state_m->i_beta = ONE_BY_SQRT3 * i[0] + TWO_BY_SQRT3 * i[1];
	utils_truncate_number_abs(&phase, 9.0);
	utils_fast_sincos_better(phase, &state_m->phase_sin, &state_m->phase_cos);
	foc_pll_run(phase, dt, &motor->m_pll_phase, &motor->m_pll_speed, motor->m_conf);
	utils_truncate_number_abs(&motor->m_pll_phase, 6.0);
	control_current(motor, dt);
	foc_svm(state_m->mod_alpha_raw, state_m->mod_beta_raw, 4200, &pwm[0], &pwm[1], &pwm[2], &state_m->svm_sector);
	*sector = state_m->svm_sector;
}
