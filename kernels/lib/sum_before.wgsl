// Exclusive sum over the threads of a workgroup of 64.

const THREADS: u32 = 64u;

var<workgroup> of_thread: array<u32, 64>;
var<workgroup> of_eight: array<u32, 8>;

/// Sum of the values of all threads before this one. All threads have to call it.
fn sum_before(thread: u32, value: u32) -> u32 {
    of_thread[thread] = value;
    workgroupBarrier();
    let first = thread & ~7u;
    var sum = 0u;
    for (var i = first; i < thread; i++) {
        sum += of_thread[i];
    }
    if (thread & 7u) == 7u {
        of_eight[thread >> 3u] = sum + value;
    }
    workgroupBarrier();
    for (var i = 0u; i < (thread >> 3u); i++) {
        sum += of_eight[i];
    }
    return sum;
}
