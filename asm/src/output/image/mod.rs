// SPDX-License-Identifier: MIT OR Apache-2.0
//! Images: a program as an ELF file, which `readelf` and debuggers can read, and back.
//!
//! `docs/image.md` describes the format for authors of other readers. Writing is deterministic: equal programs give equal
//! bytes. Reading trusts nothing: each defect is an [`ImageError`] of its own, nothing panics, and allocation is bounded by
//! the size of the file. A program that was read is one that the assembler could have made, except that any word may stand
//! in its code: the machine faults on words that encode no instruction.

mod debug;
mod meta;
mod validate;

use crate::limits;
use crate::output::names::DebugInfo;
use meta::Meta;
use object::elf;
use object::read::elf::{FileHeader as _, SectionHeader as _, Sym as _};
use object::write::elf as write;
use object::{Endianness, LittleEndian as LE};
use takt_isa::program::{LoopBound, Space, Symbol};
use takt_isa::{BundleAddress, MachineNameError, Program};

/// Maximum length of a file, in bytes.
pub const LIMIT: usize = limits::IMAGE_BYTES;
/// `e_flags` of an image: `TAK` and the version of the container.
pub const FLAGS: u32 = u32::from_be_bytes(*b"TAK\x01");
/// The version of the metadata.
pub const VERSION: u32 = 1;

const CODE: &str = ".takt.code";
const DATA: &str = ".takt.data";
const CONSTANTS: &str = ".takt.constants";
const META: &str = ".takt.meta";
/// Section of loop bounds; absent if no loop has a bound.
const LOOPS: &str = ".takt.loops";
const TOTALS: &str = ".takt.totals";
/// Section for debuggers; absent if the image is stripped.
const DEBUG: &str = ".takt.debug";

/// Reason why a file cannot be loaded as an image.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ImageError {
    /// The file does not begin like an ELF file.
    #[error("this is not an image: it does not begin like an ELF file")]
    NotElf,
    /// The file is larger than [`LIMIT`].
    #[error("an image of {bytes} bytes: the largest has {LIMIT}")]
    TooLarge {
        /// Size of the file.
        bytes: usize,
    },
    /// The file is cut short, or its structure points outside of it.
    #[error("the image is truncated or damaged: {0}")]
    Damaged(String),
    /// The ELF file is of another kind.
    #[error("this ELF file is for another machine: it is not a Takt image")]
    NotTakt,
    /// The container or the metadata is of another version.
    #[error("the image has format version {found}, and this program reads version {VERSION}")]
    Version {
        /// Version of the image.
        found: u32,
    },
    /// A section is missing.
    #[error("the image has no section `{0}`")]
    MissingSection(&'static str),
    /// A section occurs twice.
    #[error("the image has two sections `{0}`")]
    RepeatedSection(&'static str),
    /// A section's size is not a whole number of its elements.
    #[error("section `{section}` has {bytes} bytes: not a multiple of {element}")]
    SectionSize {
        /// Name of the section.
        section: &'static str,
        /// Size of the section.
        bytes: usize,
        /// Size of one element.
        element: usize,
    },
    /// The metadata cannot be parsed.
    #[error("the image's metadata cannot be read: {0}")]
    Meta(String),
    /// No machine has the name.
    #[error("the image is for a machine that is not known here: {0}")]
    UnknownMachine(MachineNameError),
    /// The machine's row, which the image carries, is invalid.
    #[error("the image's description of its machine is invalid: {0}")]
    Row(String),
    /// The code is not a whole number of bundles.
    #[error("{words} words of code: not a multiple of the {slots} slots of {machine}")]
    WordCount {
        /// Words of code in the image.
        words: usize,
        /// Slots of the machine, and words of a bundle.
        slots: usize,
        /// Name of the machine.
        machine: &'static str,
    },
    /// A word has more than 48 bits.
    #[error("word {index} of the code, 0x{word:x}, has more than 48 bits")]
    WordBits {
        /// Index of the word.
        index: usize,
        /// Value of the word.
        word: u64,
    },
    /// A memory of the machine is too small for the program.
    #[error("{found} {what}, and {machine} holds {limit}")]
    MemorySize {
        /// Unit of the amounts: bundles or words of data.
        what: &'static str,
        /// Amount in the image.
        found: usize,
        /// Capacity of the machine.
        limit: u32,
        /// Name of the machine.
        machine: &'static str,
    },
    /// A register address is in no bank, or in a bank where this register cannot be.
    #[error("{what} at register address {address}: {reason}")]
    Register {
        /// Kind and name of the register.
        what: String,
        /// Register address in the image.
        address: u32,
        /// Reason against the address.
        reason: &'static str,
    },
    /// A name that no source could declare.
    #[error("`{0}` is not a name")]
    Name(String),
    /// A name is used twice.
    #[error("two things are named `{0}`")]
    RepeatedName(String),
    /// A label points outside of its memory, or labels are not in order.
    #[error("label `{name}` at {address}: {reason}")]
    Label {
        /// Name of the label.
        name: String,
        /// Bundle or data word that the label points to.
        address: u32,
        /// Reason against the label.
        reason: &'static str,
    },
    /// The sections of the program are not `once` and then `period`, over all bundles.
    #[error("the program's sections do not cover its {bundles} bundles as `once` and then `period`")]
    Sections {
        /// Bundles of the program.
        bundles: u32,
    },
    /// A loop bound refers to no bundle, is 0, or is out of order.
    #[error("the bound of the loop at bundle {address}: {reason}")]
    Loop {
        /// Bundle that heads the loop.
        address: BundleAddress,
        /// Reason against the bound.
        reason: &'static str,
    },
    /// A range refers to no register, is empty, or is out of order.
    #[error("the range of register {register}: {reason}")]
    Range {
        /// Address of the register.
        register: u16,
        /// Reason against the range.
        reason: &'static str,
    },
    /// A range of an array is not that of a label's words, is empty, or is out of order.
    #[error("the range of the array at data word {first}: {reason}")]
    ArrayRange {
        /// First word of the array.
        first: u32,
        /// Reason against the range.
        reason: &'static str,
    },
    /// A result is not a label's words, or is out of order.
    #[error("the result at data word {first}: {reason}")]
    Result {
        /// First word of the array.
        first: u32,
        /// Reason against the result.
        reason: &'static str,
    },
    /// An assumption concerns no register, is empty, or is out of order.
    #[error("the assumption about word {word}: {reason}")]
    Assumption {
        /// Word of the operation.
        word: u32,
        /// Reason against the assumption.
        reason: &'static str,
    },
    /// The format cannot hold the program.
    #[error("an image cannot hold this program: {0}")]
    Unwritable(String),
    /// The debugging information does not fit the program.
    #[error("the image's section `{DEBUG}` cannot be used: {0}")]
    Debug(String),
    /// The source lines do not fit the code.
    #[error("the source lines do not match the code: {0}")]
    Lines(String),
}

/// A file begins like an image (or another ELF file) rather than like a source.
pub fn is_image(bytes: &[u8]) -> bool {
    bytes.starts_with(&elf::ELFMAG)
}

/// The image of a program, without debugging information.
///
/// # Errors
/// As [`write_with`].
pub fn write(program: &Program) -> Result<Vec<u8>, ImageError> {
    write_with(program, None)
}

/// The image of a program, with debugging information if given.
///
/// # Errors
/// If [`read`] would refuse the image, with the same error; or if its sizes go beyond 32 bits.
pub fn write_with(program: &Program, debug: Option<&DebugInfo>) -> Result<Vec<u8>, ImageError> {
    within(program, debug, LIMIT)
}

/// The image of a program, if it has at most `most` bytes.
fn within(program: &Program, debug: Option<&DebugInfo>, most: usize) -> Result<Vec<u8>, ImageError> {
    validate::words(&program.code)?;
    validate::constants(&constants(program), program.machine)?;
    validate::program(program)?;
    debug.map_or(Ok(()), |debug| debug::check(debug, program))?;
    let unwritable = |error: String| ImageError::Unwritable(error);
    let meta = Meta::of(program).to_json().map_err(|error| unwritable(error.to_string()))?;
    let debug = debug.map(debug::to_json).transpose().map_err(|error| unwritable(error.to_string()))?;
    let mut bytes = Vec::new();
    write_elf(program, (&meta, debug.as_deref()), &mut bytes)
        .map_err(|error| unwritable(error.to_string()))?;
    if bytes.len() > most {
        return Err(ImageError::TooLarge { bytes: bytes.len() });
    }
    Ok(bytes)
}

/// The words of the constants' section: register addresses and bits.
fn constants(program: &Program) -> Vec<u32> {
    program.constants.iter().flat_map(|&(register, bits)| [register.get().into(), bits]).collect()
}

fn write_elf(
    program: &Program,
    (meta, debug): (&[u8], Option<&[u8]>),
    bytes: &mut Vec<u8>,
) -> Result<(), object::write::Error> {
    let code: Vec<u8> = program.code.iter().flat_map(|word| word.to_le_bytes()).collect();
    let data: Vec<u8> = program.data.iter().flat_map(|word| word.to_le_bytes()).collect();
    let pair = |(first, second): (u32, u32)| {
        let [a, b, c, d] = first.to_le_bytes();
        let [e, f, g, h] = second.to_le_bytes();
        [a, b, c, d, e, f, g, h]
    };
    let constants: Vec<u8> = constants(program).into_iter().flat_map(u32::to_le_bytes).collect();
    let loops = program.loop_bounds.iter().map(|bound| (bound.address.get(), bound.most));
    let loops: Vec<u8> = loops.flat_map(pair).collect();
    let totals = program.loop_bounds.iter().filter_map(|bound| Some((bound.address.get(), bound.total?)));
    let totals: Vec<u8> = totals.flat_map(pair).collect();
    // First reserve the place of everything, then write it there, in the same order.
    let mut writer = write::Writer::new(Endianness::Little, false, bytes);
    writer.reserve_file_header();
    let mut contents = vec![
        (CODE, &code[..], 8, elf::SHF_ALLOC | elf::SHF_EXECINSTR),
        (DATA, &data[..], 4, elf::SHF_ALLOC | elf::SHF_WRITE),
        (CONSTANTS, &constants[..], 4, elf::SHF_ALLOC),
        (META, meta, 1, elf::SectionFlags(0)),
    ];
    if !loops.is_empty() {
        contents.push((LOOPS, &loops[..], 4, elf::SectionFlags(0)));
    }
    if !totals.is_empty() {
        contents.push((TOTALS, &totals[..], 4, elf::SectionFlags(0)));
    }
    if let Some(debug) = debug {
        contents.push((DEBUG, debug, 1, elf::SectionFlags(0)));
    }
    writer.reserve_null_section_index();
    let mut place = |(name, content, align, flags): (&'static str, _, _, _)| {
        let content: &[u8] = content;
        let index = writer.reserve_section_index();
        let id = writer.add_section_name(name.as_bytes());
        let offset = writer.reserve(content.len() as u64, align);
        (index, id, offset, content, align, flags)
    };
    let sections: Vec<_> = contents.into_iter().map(&mut place).collect();
    writer.reserve_null_symbol_index();
    let labels: Vec<_> = program
        .symbols
        .iter()
        .map(|symbol| {
            writer.reserve_symbol_index(None);
            writer.add_string(symbol.name.as_bytes())
        })
        .collect();
    writer.reserve_symtab_section_index();
    writer.reserve_symtab();
    writer.reserve_strtab_section_index();
    writer.reserve_strtab()?;
    writer.reserve_shstrtab_section_index();
    writer.reserve_shstrtab()?;
    writer.reserve_section_headers();

    writer.write_file_header(&write::FileHeader {
        os_abi: elf::ELFOSABI_NONE,
        abi_version: 0,
        e_type: elf::ET_EXEC,
        e_machine: elf::EM_NONE,
        e_entry: 0,
        e_flags: elf::FileFlags(FLAGS),
    })?;
    for (_, _, _, content, align, _) in &sections {
        writer.write_align(*align);
        writer.write(content);
    }
    writer.write_null_symbol();
    write_symbols(&mut writer, program, &labels, [sections[0].0, sections[1].0]);
    writer.write_strtab();
    writer.write_shstrtab();
    writer.write_null_section_header();
    for (_, id, offset, content, align, flags) in sections {
        let sh_name = writer.section_name_offset(Some(id));
        writer.write_section_header(&write::SectionHeader {
            sh_name,
            sh_type: elf::SHT_PROGBITS,
            sh_flags: flags,
            sh_offset: offset,
            sh_size: content.len() as u64,
            sh_addralign: align,
            ..Default::default()
        });
    }
    // The null symbol is the only local one.
    writer.write_symtab_section_header(1);
    writer.write_strtab_section_header();
    writer.write_shstrtab_section_header();
    Ok(())
}

/// Writes the symbols, which lie in the sections of code and data.
fn write_symbols(
    writer: &mut write::Writer<'_>,
    program: &Program,
    labels: &[object::write::StringId],
    [code, data]: [write::SectionIndex; 2],
) {
    for (symbol, name) in program.symbols.iter().zip(labels) {
        let (section, kind) = match symbol.space {
            Space::Code => (code, elf::STT_FUNC),
            Space::Data => (data, elf::STT_OBJECT),
        };
        let symbol = write::Sym {
            st_name: writer.string_offset(Some(*name)),
            section: Some(section.0),
            st_info: elf::SymbolInfo::new(elf::STB_GLOBAL, kind),
            st_other: elf::SymbolOther::default(),
            st_shndx: elf::SHN_UNDEF,
            st_value: symbol.address.into(),
            st_size: 0,
        };
        writer.write_symbol(&symbol);
    }
}

/// The program of an image.
///
/// # Errors
/// Returns the first defect in the file.
pub fn read(bytes: &[u8]) -> Result<Program, ImageError> {
    Ok(read_with(bytes)?.0)
}

/// The program of an image, and its debugging information unless it is stripped.
///
/// # Errors
/// Returns the first defect in the file.
pub fn read_with(bytes: &[u8]) -> Result<(Program, Option<DebugInfo>), ImageError> {
    if !is_image(bytes) {
        return Err(ImageError::NotElf);
    }
    if bytes.len() > LIMIT {
        return Err(ImageError::TooLarge { bytes: bytes.len() });
    }
    let ident = |index: usize| bytes.get(index).copied();
    if bytes.len() >= 16 && (ident(4), ident(5)) != (Some(1), Some(1)) {
        return Err(ImageError::NotTakt);
    }
    let header = elf::FileHeader32::<LE>::parse(bytes).map_err(damaged)?;
    let flags = header.e_flags(LE).0;
    if header.e_machine(LE) != elf::EM_NONE || flags >> 8 != FLAGS >> 8 {
        return Err(ImageError::NotTakt);
    }
    if flags != FLAGS {
        return Err(ImageError::Version { found: flags & 0xff });
    }
    let sections = header.sections(LE, bytes).map_err(damaged)?;
    let optional = |name: &'static str| -> Result<Option<(usize, &[u8])>, ImageError> {
        let mut found = None;
        for (index, header) in sections.iter().enumerate() {
            if sections.section_name(LE, header).map_err(damaged)? != name.as_bytes() {
                continue;
            }
            if found.is_some() {
                return Err(ImageError::RepeatedSection(name));
            }
            if header.sh_type(LE) != elf::SHT_PROGBITS {
                return Err(ImageError::Damaged(format!("section `{name}` has no contents")));
            }
            found = Some((index, header.data(LE, bytes).map_err(damaged)?));
        }
        Ok(found)
    };
    let section = |name| optional(name)?.ok_or(ImageError::MissingSection(name));
    let elements = |name: &'static str, content: &[u8], element: usize| match content.len() % element {
        0 => Ok(()),
        _ => Err(ImageError::SectionSize { section: name, bytes: content.len(), element }),
    };
    let meta = Meta::from_json(section(META)?.1)?;
    let machine = meta.machine()?;
    let (code_index, code) = section(CODE)?;
    elements(CODE, code, 8)?;
    let (data_index, data) = section(DATA)?;
    elements(DATA, data, 4)?;
    let (_, constants) = section(CONSTANTS)?;
    elements(CONSTANTS, constants, 8)?;
    let loops = optional(LOOPS)?.map_or(&[][..], |(_, loops)| loops);
    elements(LOOPS, loops, 8)?;
    let totals = optional(TOTALS)?.map_or(&[][..], |(_, totals)| totals);
    elements(TOTALS, totals, 8)?;
    let words = |content: &[u8]| -> Vec<u32> {
        content.as_chunks::<4>().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect()
    };
    let code: Vec<u64> = code.as_chunks::<8>().0.iter().map(|bytes| u64::from_le_bytes(*bytes)).collect();
    validate::words(&code)?;
    let constants = validate::constants(&words(constants), machine)?;
    let symbols = symbols(&sections, bytes, code_index, data_index)?;
    let mut program = meta.into_program(machine, code, words(data), constants, symbols)?;
    let bound =
        |&[address, most]: &[u32; 2]| LoopBound { address: BundleAddress::new(address), most, total: None };
    program.loop_bounds = words(loops).as_chunks::<2>().0.iter().map(bound).collect();
    for &[address, total] in words(totals).as_chunks::<2>().0 {
        let address = BundleAddress::new(address);
        let mut bounds = program.loop_bounds.iter_mut();
        let Some(bound) = bounds.find(|bound| bound.address == address && bound.total.is_none()) else {
            return Err(ImageError::Loop { address, reason: "a total without a bound, or twice" });
        };
        bound.total = Some(total);
    }
    validate::program(&program)?;
    let debug = optional(DEBUG)?;
    let debug = debug.map(|(_, debug)| debug::from_json(debug, &program)).transpose()?;
    Ok((program, debug))
}

fn damaged(error: object::read::Error) -> ImageError {
    ImageError::Damaged(error.to_string())
}

/// Labels of an image, given the indices of its sections for code and data.
fn symbols(
    sections: &object::read::elf::SectionTable<'_, elf::FileHeader32<LE>>,
    bytes: &[u8],
    code: usize,
    data: usize,
) -> Result<Vec<Symbol>, ImageError> {
    let table = sections.symbols(LE, bytes, elf::SHT_SYMTAB).map_err(damaged)?;
    let mut symbols = Vec::new();
    // The first is the null symbol.
    for symbol in table.iter().skip(1) {
        let name = symbol.name(LE, table.strings()).map_err(damaged)?;
        let name = std::str::from_utf8(name)
            .map_err(|_| ImageError::Name(String::from_utf8_lossy(name).into_owned()))?
            .to_owned();
        let address = symbol.st_value(LE);
        let space = match symbol.st_shndx(LE).0 as usize {
            index if index == code => Space::Code,
            index if index == data => Space::Data,
            _ => {
                return Err(ImageError::Label { name, address, reason: "it is in neither code nor data" });
            }
        };
        symbols.push(Symbol { name, space, address });
    }
    Ok(symbols)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_that_could_not_be_read_is_not_written() {
        let program = crate::assemble(
            "a.s",
            &crate::MemoryLoader::of("a.s", "here: jmp here\n"),
            &crate::Options::default(),
        );
        let program = program.expect("it is right").program;
        let bytes = write(&program).expect("it is small").len();
        assert!(within(&program, None, bytes).is_ok());
        assert_eq!(within(&program, None, bytes - 1), Err(ImageError::TooLarge { bytes }));
    }
}
