in vec3 v_direction;
in vec2 v_place;

uniform vec3 sky_bottom;
uniform vec3 sky_top;
uniform vec3 sky_up;
uniform float exposure;
uniform bool is_linear;
#ifdef IMAGES
uniform sampler2D image;
#endif

out vec4 seen;

void main() {
    vec3 direction = normalize(v_direction);
    vec3 light = mix(sky_bottom, sky_top, 0.5 + 0.5 * dot(direction, sky_up));
#ifdef IMAGES
    const float TURN = 6.28318530717958647692;
    float u = 0.5 + atan(direction.x, -direction.z) / TURN;
    float v = 0.5 - asin(clamp(direction.y, -1.0, 1.0)) * 2.0 / TURN;
    light = sky_bottom * textureLod(image, vec2(u, v), 0.0).rgb;
#endif
    seen = vec4(encoded(light * exposure, is_linear), 1.0);
}
