// Linear values as the picture's bytes have them (IEC 61966-2-1): within a fifth of a byte, from roots alone, since a power for
// each pixel costs more than all else where the processor draws (Taylor 2013, "sRGB approximations for HLSL").
vec3 encoded(vec3 linear, bool is_linear) {
    vec3 c = clamp(linear, 0.0, 1.0);
    vec3 half_power = sqrt(c);
    vec3 quarter = sqrt(half_power);
    vec3 eighth = sqrt(quarter);
    vec3 curved = 0.662002687 * half_power + 0.684122060 * quarter - 0.323583601 * eighth - 0.0225411470 * c;
    return is_linear ? c : mix(curved, c * 12.92, vec3(lessThanEqual(c, vec3(0.0031308))));
}
