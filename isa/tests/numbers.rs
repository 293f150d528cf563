// SPDX-License-Identifier: MIT OR Apache-2.0
//! Newtypes of numbers stay in their ranges, and serialise as plain numbers.

use takt_isa::{BankIndex, BundleAddress, Flow, Instruction, MACHINES, Operand, ROWS, Register, SlotIndex};

#[test]
fn only_numbers_in_range_are_made() {
    assert_eq!(Register::new(1023), Some(Register::ZERO));
    assert_eq!(Register::new(1024), None);
    assert_eq!(BankIndex::new(1024), None);
    assert_eq!(SlotIndex::new(8), None);
    // Numbers beyond the inner type are rejected, too.
    assert_eq!(Register::new(65536), None);
    assert_eq!(SlotIndex::new(256), None);
    for (number, register) in Register::all().enumerate() {
        assert_eq!((register.index(), usize::from(register.get())), (number, number));
    }
    assert_eq!(Register::all().count(), Register::COUNT);
    assert_eq!(format!("{0} {0:>3} {0:?}", SlotIndex::new(7).unwrap()), "7   7 SlotIndex(7)");
}

#[test]
fn a_bank_has_registers_up_to_its_depth() {
    for machine in MACHINES {
        for bank in machine.banks() {
            let past = usize::from(bank.depth);
            assert_eq!(BankIndex::new(past).and_then(|index| bank.register(index)), None);
            assert_eq!(
                Register::new(usize::from(bank.base) + past).and_then(|after| bank.index(after)),
                None
            );
            let before = Register::new(usize::from(bank.base).wrapping_sub(1));
            assert_eq!(before.and_then(|before| bank.index(before)), None);
        }
    }
}

#[test]
fn addresses_stay_within_their_type() {
    let address = BundleAddress::new(7);
    assert_eq!((address.next().get(), address.previous().get(), address.offset(5).get()), (8, 6, 12));
    assert_eq!((address.since(BundleAddress::new(3)), BundleAddress::new(3).since(address)), (4, 0));
    assert_eq!(BundleAddress::RESET.previous(), BundleAddress::RESET);
    assert_eq!(BundleAddress::new(u32::MAX).next().get(), u32::MAX);
    assert!(address.until(BundleAddress::new(9)).map(BundleAddress::get).eq([7, 8]));
    assert_eq!(address.until(BundleAddress::new(2)).count(), 0);
}

/// Every instruction with a target leads to it, and no other; every redirection differs from [`Flow::Next`].
#[test]
fn the_flow_of_every_row() {
    for row in ROWS {
        let mut instruction = Instruction { constant: 77, ..Instruction::bare(row.op) };
        instruction.sources[0] = Register::ZERO;
        let flow = instruction.flow();
        let has_target = row.shape.operands().contains(&Operand::Target);
        // A loop's target is its end.
        let leads = has_target && !matches!(flow, Flow::Loop { .. });
        assert_eq!(flow.target(), leads.then(|| BundleAddress::new(77)), "{}", row.mnemonic);
        assert_eq!(flow != Flow::Next, row.effect.redirects(), "{}", row.mnemonic);
        let branches = matches!(flow, Flow::Branch { register: Register::ZERO, .. });
        assert_eq!(branches, row.effect.is_conditional(), "{}", row.mnemonic);
        assert_eq!(Flow::of([&Instruction::NOP, &instruction]), flow);
    }
}
