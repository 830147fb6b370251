// Numbers of workgroups that a user's kernel has left, with none where an adapter could not dispatch as many.

@group(0) @binding(0) var<storage, read> groups: array<u32>;
@group(0) @binding(1) var<storage, read_write> limited: array<u32>;

/// The most workgroups a side of a dispatch may have on any adapter.
const MOST_GROUPS: u32 = 65535u;

@compute @workgroup_size(1)
fn limit() {
    let fits = max(groups[0], max(groups[1], groups[2])) <= MOST_GROUPS;
    for (var i = 0u; i < 3u; i++) {
        limited[i] = select(0u, groups[i], fits);
    }
}
