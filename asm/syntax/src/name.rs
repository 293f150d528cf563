// SPDX-License-Identifier: MIT OR Apache-2.0
//! Numbers that stand for names and for templates of names.

/// Number of an interned name.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, PartialOrd, Ord)]
pub struct NameId(pub u32);

/// A name as written: plain, or a template such as `l{i}` whose text depends on where it is expanded.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct NameRef(u32);

impl NameRef {
    const TEMPLATE: u32 = 1 << 31;

    /// The reference to a plain name.
    #[inline]
    pub const fn plain(name: NameId) -> NameRef {
        NameRef(name.0)
    }

    /// The template of this index in [`Ast::templates`].
    pub const fn template(index: u32) -> NameRef {
        NameRef(index | NameRef::TEMPLATE)
    }

    /// The plain name, or else the template's index.
    #[inline]
    pub const fn resolve(self) -> Result<NameId, usize> {
        if self.0 & NameRef::TEMPLATE == 0 {
            Ok(NameId(self.0))
        } else {
            Err((self.0 & !NameRef::TEMPLATE) as usize)
        }
    }
}
