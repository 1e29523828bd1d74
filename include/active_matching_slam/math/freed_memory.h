#pragma once

namespace active_matching_slam {

/// Lets the process keep what it frees for its next matrices, up to 128 MB, instead of handing it
/// back to the system and asking for it page by page again: of a frame that lays a submap aside
/// that is most of the time. With another C library than glibc nothing happens. Applies to the whole
/// process: for main() alone to call, never for a library. A nodelet's manager is set by
/// MALLOC_MMAP_THRESHOLD_ and MALLOC_TRIM_THRESHOLD_ in its environment.
void keepFreedMemory();

}  // namespace active_matching_slam
