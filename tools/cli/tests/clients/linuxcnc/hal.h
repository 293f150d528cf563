// SPDX-License-Identifier: MIT OR Apache-2.0
// Subset of LinuxCNC's hal.h for hal_takt.c, with pins found by name.
#ifndef HAL_H
#define HAL_H
#include <stdint.h>
typedef volatile unsigned char hal_bit_t;
typedef volatile uint32_t hal_u32_t;
typedef volatile double hal_float_t;
enum { HAL_IN, HAL_OUT, HAL_RW };
typedef void (*hal_function)(void *, long);
int hal_init(const char *name);
int hal_exit(int component);
int hal_ready(int component);
void *hal_malloc(long size);
int hal_pin_bit_newf(int way, hal_bit_t **pin, int component, const char *format, ...);
int hal_pin_u32_newf(int way, hal_u32_t **pin, int component, const char *format, ...);
int hal_pin_float_newf(int way, hal_float_t **pin, int component, const char *format, ...);
int hal_param_float_newf(int way, hal_float_t *pin, int component, const char *format, ...);
int hal_export_funct(const char *name, hal_function function, void *argument, int is_float, int is_reentrant, int component);
#endif
