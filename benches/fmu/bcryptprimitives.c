/* SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * The one function of Windows' bcryptprimitives.dll that Rust's standard library calls, for a Wine that lacks the file (8.0, of Debian 12).
 * The library of FMUs imports it, and draws no random number that shows in a result: only the seeds of hash tables. */
#include <windows.h>
#include <ntsecapi.h>

__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE data, SIZE_T size) {
    return RtlGenRandom(data, (ULONG)size);
}
