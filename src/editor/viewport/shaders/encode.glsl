// Linear values as the picture's bytes have them (IEC 61966-2-1).
vec3 encoded(vec3 linear, bool is_linear) {
    vec3 c = clamp(linear, 0.0, 1.0);
    vec3 curved = 1.055 * pow(max(c, vec3(1e-6)), vec3(1.0 / 2.4)) - 0.055;
    return is_linear ? c : mix(curved, c * 12.92, vec3(lessThanEqual(c, vec3(0.0031308))));
}
