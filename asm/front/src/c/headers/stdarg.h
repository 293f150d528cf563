#ifndef TAKT_STDARG_H
#define TAKT_STDARG_H
typedef char *va_list;
#endif
