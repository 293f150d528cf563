/** Why something failed, in words: libraries reject with texts and with nothing at all, too. */
export function reason(error: unknown): string {
  if (error instanceof Error) return error.message;
  return typeof error === 'string' && error ? error : 'no reason was given';
}
