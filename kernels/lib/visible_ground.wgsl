// The ground under everything that the camera can see of the terrain.

/// The first and the last of the terrain's samples around it, by columns and by rows; the sample nearest to the eye, if it sees none.
struct VisibleGround {
    @align(16) low: vec2<i32>,
    high: vec2<i32>,
}
