// SPDX-License-Identifier: MIT OR Apache-2.0
int rtapi_app_main(void);
void rtapi_app_exit(void);
