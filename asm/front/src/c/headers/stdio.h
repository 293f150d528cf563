#ifndef TAKT_STDIO_H
#define TAKT_STDIO_H
#include <stddef.h>
typedef struct takt_file FILE;
extern FILE *stdout, *stderr;
int printf(const char *format, ...);
int fprintf(FILE *to, const char *format, ...);
int snprintf(char *to, size_t size, const char *format, ...);
int puts(const char *text);
#endif
