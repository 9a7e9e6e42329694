//! Memory in large pages: a search that jumps through a large tree otherwise waits for addresses to be translated.

/// Asks the system to hold what will be put into a vector in huge pages, which are 2 MiB; a request only, and nothing where the room
/// is smaller or the system is not Linux. To be called before the room is used.
pub fn prefer_huge_pages<T>(room: &mut Vec<T>) {
    #[cfg(target_os = "linux")]
    {
        const PAGE: usize = 4096;
        const WORTH: usize = 4 << 20;
        let room = room.spare_capacity_mut();
        let size = size_of_val(room);
        if size >= WORTH {
            let start = room.as_mut_ptr().cast::<u8>();
            let skipped = start.align_offset(PAGE);
            // SAFETY: the pages lie within memory that is ours, and the advice does not change what is in it.
            unsafe {
                libc::madvise(start.add(skipped).cast(), (size - skipped) & !(PAGE - 1), libc::MADV_HUGEPAGE);
            }
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = room;
}
