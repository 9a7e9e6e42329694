//! Standard input and pipes that an interrupt can end while they wait for more.

use std::io::{self, Read};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

use crate::progress::Progress;

/// Bytes that are passed on at once.
const PIECE: usize = 1 << 16;

/// How long an interrupt may go unnoticed.
const PATIENCE: Duration = Duration::from_millis(50);

/// Bytes that are read by a thread of its own: the system's opening and reading cannot be ended from outside.
pub struct Stream<'a> {
    pieces: Receiver<io::Result<Vec<u8>>>,
    current: io::Cursor<Vec<u8>>,
    progress: &'a dyn Progress,
}

impl<'a> Stream<'a> {
    /// Begins to read what `open` gives. The thread ends with the input, or with the process.
    pub fn new<R: Read>(open: impl FnOnce() -> io::Result<R> + Send + 'static, progress: &'a dyn Progress) -> Self {
        let (sender, pieces) = sync_channel(4);
        std::thread::spawn(move || {
            let mut source = match open() {
                Ok(source) => source,
                Err(error) => {
                    // Nobody may be left to hear it.
                    let _ = sender.send(Err(error));
                    return;
                }
            };
            loop {
                let mut piece = vec![0; PIECE];
                let read = source.read(&mut piece).map(|length| {
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

impl Read for Stream<'_> {
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
