#ifndef TAKT_STDLIB_H
#define TAKT_STDLIB_H
#include <stddef.h>
int abs(int x);
long labs(long x);
void *malloc(size_t size);
void *calloc(size_t count, size_t size);
void *realloc(void *old, size_t size);
void free(void *old);
#endif
