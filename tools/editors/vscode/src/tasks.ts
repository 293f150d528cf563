// Tasks: commands of `takt` on a source.

/** Definition of a task of this type. */
export interface Definition { type: 'takt'; command: string; file: string; arguments?: string[] }

/** Commands that are offered for a source. */
export const COMMANDS = ['asm', 'bound', 'analyse', 'run'] as const;

/** Words of a task's command line, or an error message. */
export function words(program: string, definition: Partial<Definition>): string[] | string {
  const { command, file, arguments: more } = definition;
  if (typeof command !== 'string' || !/^[a-z][a-z-]*$/.test(command)) return '`command` is what `takt` is to do, as `asm`';
  if (typeof file !== 'string' || file === '') return '`file` is the source';
  if (more !== undefined && !(Array.isArray(more) && more.every((word) => typeof word === 'string'))) {
    return '`arguments` is a list of words';
  }
  return [program, command, file, ...(more ?? [])];
}
