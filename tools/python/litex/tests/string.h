/* What a program's C header needs of the library; the compiler makes moves of it. */
#include <stddef.h>
void *memcpy(void *to, const void *from, size_t bytes);
