#pragma once

namespace hybrid_slam {

// What tames terms beyond their threshold. kCauchy grows with the logarithm only: it lets go.
enum class Loss { kNone, kHuber, kCauchy };

}  // namespace hybrid_slam
