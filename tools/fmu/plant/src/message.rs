// SPDX-License-Identifier: MIT OR Apache-2.0
//! Messages between a plant and the process of its FMU: numbers, or the text of a failure, each behind its length.

use std::io::{self, Read, Write};

/// Bytes of a message, at most: more than all variables of a description need.
const BYTES: usize = 32 << 20;

/// A message.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Message {
    /// Numbers, whose meaning both sides know.
    Numbers(Vec<f64>),
    /// Reason why a request failed.
    Failed(String),
}

impl Message {
    pub(crate) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let (tag, body) = match self {
            Message::Numbers(numbers) => {
                (0, numbers.iter().flat_map(|number| number.to_le_bytes()).collect())
            }
            Message::Failed(text) => (1, text.clone().into_bytes()),
        };
        let length = u32::try_from(body.len()).ok().filter(|length| *length as usize <= BYTES);
        let length = length.ok_or_else(|| io::Error::other("a message is too long"))?;
        let head = [&length.to_le_bytes()[..], &[tag]].concat();
        out.write_all(&[head, body].concat())?;
        out.flush()
    }

    /// Reads a message; `UnexpectedEof` if the other side has ended.
    pub(crate) fn read(from: &mut impl Read) -> io::Result<Message> {
        let mut head = [0; 5];
        from.read_exact(&mut head)?;
        let [a, b, c, d, tag] = head;
        let length = u32::from_le_bytes([a, b, c, d]) as usize;
        if length > BYTES {
            return Err(io::Error::other("a message is too long"));
        }
        let mut body = vec![0; length];
        from.read_exact(&mut body)?;
        match tag {
            0 => {
                let numbers = body.chunks_exact(8).map(|bytes| bytes.try_into().map(f64::from_le_bytes));
                Ok(Message::Numbers(numbers.collect::<Result<_, _>>().map_err(io::Error::other)?))
            }
            _ => Ok(Message::Failed(String::from_utf8_lossy(&body).into_owned())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_come_back() {
        for message in [
            Message::Numbers(vec![]),
            Message::Numbers(vec![1.5, f64::INFINITY, -0.0]),
            Message::Failed("größer".to_owned()),
        ] {
            let mut bytes = Vec::new();
            message.write(&mut bytes).unwrap();
            assert_eq!(Message::read(&mut &bytes[..]).unwrap(), message);
            let cut = Message::read(&mut &bytes[..bytes.len() - 1]);
            assert_eq!(cut.map_err(|error| error.kind()), Err(io::ErrorKind::UnexpectedEof));
        }
        assert!(Message::read(&mut &[0xff; 5][..]).is_err());
    }
}
