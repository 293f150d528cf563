// SPDX-License-Identifier: MIT OR Apache-2.0
// Subset of LinuxCNC's rtapi.h for hal_takt.c, in a program that calls the component without LinuxCNC.
#ifndef RTAPI_H
#define RTAPI_H
#define RTAPI_MSG_ERR 1
#define RTAPI_MP_STRING(name, text)
#define RTAPI_MP_INT(name, text)
#define MODULE_DESCRIPTION(text)
#define MODULE_AUTHOR(text)
#define MODULE_LICENSE(text)
void rtapi_print_msg(int level, const char *format, ...);
#endif
