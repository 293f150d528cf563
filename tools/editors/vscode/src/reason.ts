/** Text for an error: libraries also reject with strings, and with nothing at all. */
export function reason(error: unknown): string {
  if (error instanceof Error) return error.message;
  return typeof error === 'string' && error ? error : 'no reason was given';
}
