in vec4 v_tinted;
in vec3 v_plain;
in vec2 v_uv;
in vec2 v_glow_uv;

uniform sampler2D image;
uniform sampler2D glow_image;
uniform bool has_image;
uniform bool has_glow_image;
uniform vec3 glow;
// What multiplies alpha; the alpha below which there is nothing; 1 where vertices' and the image's alpha count.
uniform vec3 alpha;
uniform float exposure;
uniform bool is_linear;

out vec4 seen;

void main() {
    vec4 texel = has_image ? texture(image, v_uv) : vec4(1.0);
    float here = alpha.x * (alpha.z > 0.5 ? texel.a * v_tinted.a : 1.0);
    if (here < alpha.y) {
        discard;
    }
    vec3 light = v_tinted.rgb * texel.rgb + v_plain;
    if (has_glow_image) {
        light += glow * texture(glow_image, v_glow_uv).rgb;
    }
    float opacity = alpha.y > 0.0 ? 1.0 : here;
    seen = vec4(encoded(light * exposure, is_linear) * opacity, opacity);
}
