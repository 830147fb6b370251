// Stream compaction of lists whose length only the GPU knows: each thread says how much it wants to append, one thread for 64 of them
// sums that up, one workgroup goes over these sums, and after that each thread knows where it writes. Nobody waits for another
// workgroup, and the threads of one only where a single workgroup runs: software adapters pay for a barrier with every thread.

/// Threads whose wishes are summed up by one.
const GROUP: u32 = 64u;
/// The most workgroups a side of a dispatch may have on any adapter.
const MOST_GROUPS: u32 = 65535u;

/// Workgroups along x, y and z to visit a list with `threads` threads each element, and its length.
fn work_for(length: u32, threads: u32) -> vec4<u32> {
    let groups = (length * threads + GROUP - 1u) / GROUP;
    let wide = min(groups, MOST_GROUPS);
    return vec4(wide, (groups + max(wide, 1u) - 1u) / max(wide, 1u), min(groups, 1u), length);
}

/// Number of a thread of a workgroup of 64, in a dispatch of two dimensions.
fn thread_number(group: vec3<u32>, groups: vec3<u32>, lane: u32) -> u32 {
    return (group.y * groups.x + group.x) * GROUP + lane;
}
