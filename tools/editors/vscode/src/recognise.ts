// Tells sources of Takt from those of other assemblers, which are called *.s too.
const OWN = /^[ \t]*\.(period|once|schedule|ports|input|output|state|rep|endfor)\b/m;

/** The beginning of the text has a directive that GNU's assembler does not know. */
export function isSource(text: string): boolean {
  return OWN.test(text.slice(0, 65_536));
}
