//! Standard input that an interrupt can end while it waits for more.

use std::io::{self, Read};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

use crate::progress::Progress;

/// Bytes that are passed on at once.
const PIECE: usize = 1 << 16;

/// How long an interrupt may go unnoticed.
const PATIENCE: Duration = Duration::from_millis(50);

/// Standard input, read by a thread of its own: the system's reading cannot be ended from outside.
pub struct StandardInput<'a> {
    pieces: Receiver<io::Result<Vec<u8>>>,
    current: io::Cursor<Vec<u8>>,
    progress: &'a dyn Progress,
}

impl<'a> StandardInput<'a> {
    /// Begins to read. The thread ends with the input, or with the process.
    pub fn new(progress: &'a dyn Progress) -> Self {
        let (sender, pieces) = sync_channel(4);
        std::thread::spawn(move || {
            let mut stdin = io::stdin().lock();
            loop {
                let mut piece = vec![0; PIECE];
                let read = stdin.read(&mut piece).map(|length| {
                    piece.truncate(length);
                    piece
                });
                let last = matches!(&read, Ok(piece) if piece.is_empty());
                let fatal = matches!(&read, Err(error) if error.kind() != io::ErrorKind::Interrupted);
                if sender.send(read).is_err() || last || fatal {
                    return;
                }
            }
        });
        Self { pieces, current: io::Cursor::default(), progress }
    }
}

impl Read for StandardInput<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let length = self.current.read(buffer)?;
            if length > 0 || buffer.is_empty() {
                return Ok(length);
            }
            match self.pieces.recv_timeout(PATIENCE) {
                Ok(piece) => {
                    let piece = piece?;
                    if piece.is_empty() {
                        return Ok(0);
                    }
                    self.current = io::Cursor::new(piece);
                }
                Err(RecvTimeoutError::Disconnected) => return Ok(0),
                Err(RecvTimeoutError::Timeout) if self.progress.is_cancelled() => {
                    return Err(io::Error::other("interrupted"));
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }
}
