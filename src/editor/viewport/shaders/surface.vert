// The shading formula at a vertex: what the diffuse texture multiplies, and what it does not.
const int MOST_LIGHTS = 16;

in vec3 position;
in vec4 normal;
in vec4 uvs;
in vec4 color;

uniform mat4 to_clip;
uniform mat4 to_world;
uniform mat4 normal_to_world;
// The eye, relative to the same origin as the lights, and 1; or the vector towards it and 0.
uniform vec4 eye;

uniform int light_count;
uniform vec4 light_places[MOST_LIGHTS];
uniform vec4 light_colors[MOST_LIGHTS];
uniform vec4 light_cones[MOST_LIGHTS];
uniform float light_rims[MOST_LIGHTS];

uniform vec3 tinted;
uniform vec3 diffuse;
uniform vec3 steady;
uniform vec4 shine;
uniform vec3 mirror;
uniform vec3 sky_bottom;
uniform vec3 sky_top;
uniform vec3 sky_up;
uniform vec4 uv_matrix;
uniform vec4 uv_offset;
uniform vec4 glow_matrix;
uniform vec4 glow_offset;

out vec4 v_tinted;
out vec3 v_plain;
out vec2 v_uv;
out vec2 v_glow_uv;

vec2 placed(vec4 matrix, vec4 offset) {
    vec2 uv = offset.z > 0.5 ? uvs.zw : uvs.xy;
    vec2 at = matrix.xy * uv.x + matrix.zw * uv.y + offset.xy;
    // Images have their first row at the top.
    return vec2(at.x, 1.0 - at.y);
}

void main() {
    gl_Position = to_clip * vec4(position, 1.0);
    v_uv = placed(uv_matrix, uv_offset);
    v_glow_uv = placed(glow_matrix, glow_offset);

    vec3 at = (to_world * vec4(position, 1.0)).xyz;
    vec3 to_eye = normalize(eye.xyz - at * eye.w);
    vec3 n = normalize((normal_to_world * vec4(normal.xyz, 0.0)).xyz);
    // Both sides are lit.
    n = dot(n, to_eye) < 0.0 ? -n : n;
    vec3 reflected = 2.0 * dot(n, to_eye) * n - to_eye;

    vec3 lit = vec3(0.0);
    vec3 glossy = vec3(0.0);
    bool is_glossy = shine.x + shine.y + shine.z > 0.0;
    for (int i = 0; i < light_count; i++) {
        vec4 place = light_places[i];
        vec3 offset = place.xyz - at * place.w;
        float squared = dot(offset, offset);
        vec3 l = offset * inversesqrt(squared);
        float n_dot_l = dot(n, l);
        float strength = light_colors[i].w > 0.5 ? 1.0 / squared : 1.0;
        vec4 cone = light_cones[i];
        if (cone.w > -1.5) {
            float cosine = -dot(l, cone.xyz);
            float share = clamp((cosine - light_rims[i]) / max(cone.w - light_rims[i], 1e-6), 0.0, 1.0);
            strength *= cosine >= cone.w ? 1.0 : share * share;
        }
        vec3 arriving = n_dot_l > 0.0 ? light_colors[i].xyz * strength : vec3(0.0);
        lit += arriving * n_dot_l;
        if (is_glossy) {
            // R.V with the eye mirrored, not the light: the same.
            glossy += arriving * pow(max(dot(reflected, l), 1e-9), shine.w);
        }
    }
    vec3 sky = mix(sky_bottom, sky_top, 0.5 + 0.5 * dot(reflected, sky_up));
    v_tinted = vec4((tinted + diffuse * lit) * color.rgb, color.a);
    v_plain = steady + shine.xyz * glossy + mirror * sky;
}
